// A prepared statement of PostgreSQL.
//
// The server infers the types of the parameters, and values are converted to
// them: an integer to a truth value, for one. Parameters and results are
// transferred in binary form.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "server/store/postgres/postgres_connection.h"

namespace selfcal::server {

class PostgresStatement final : public PreparedStatement {
 public:
  // The connection must outlive the statement.
  static absl::StatusOr<std::unique_ptr<PreparedStatement>> Prepare(
      PostgresConnection* connection, std::string_view sql);
  ~PostgresStatement() override;

  absl::Status BindInt(int index, std::int64_t value) override;
  absl::Status BindDouble(int index, double value) override;
  absl::Status BindText(int index, std::string_view value) override;
  absl::Status BindBlob(int index, std::string_view bytes) override;
  absl::StatusOr<bool> Step() override;
  std::int64_t Int(int column) const override;
  double Double(int column) const override;
  std::string Text(int column) const override;
  bool IsNull(int column) const override;
  void Reset() override;

  // Reads the rest of the rows into memory, so that the connection is free.
  void BufferRest();

 private:
  // NULL, an integer, a double, text, or bytes of the caller.
  using Value = std::variant<std::monostate,
                             std::int64_t,
                             double,
                             std::string,
                             std::string_view>;

  PostgresStatement(PostgresConnection* connection,
                    std::string_view sql,
                    std::string name,
                    std::vector<Oid> types)
      : PreparedStatement(sql),
        connection_(connection),
        name_(std::move(name)),
        types_(std::move(types)),
        values_(types_.size()) {}
  absl::Status Bind(int index, Value value);
  absl::Status Send();
  // The next row from the server; null at the end, whose status is end_.
  PostgresResult Receive();

  PostgresConnection* const connection_;
  const std::string name_;        // of the server's
  const std::vector<Oid> types_;  // of the parameters
  std::vector<Value> values_;
  bool running_ = false;
  bool streaming_ = false;  // the server has more
  std::deque<PostgresResult> buffered_;
  PostgresResult row_;
  absl::Status end_;
};

// `sql` with $1 for ?1, outside of quotes.
std::string WithDollarParameters(std::string_view sql);

}  // namespace selfcal::server
