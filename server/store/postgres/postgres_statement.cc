#include "server/store/postgres/postgres_statement.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr int kBinary = 1;

// Types of the server, src/include/catalog/pg_type.dat: their numbers never
// change.
constexpr Oid kBool = 16;
constexpr Oid kInt8 = 20;
constexpr Oid kInt2 = 21;
constexpr Oid kInt4 = 23;
constexpr Oid kOid = 26;
constexpr Oid kFloat4 = 700;
constexpr Oid kFloat8 = 701;

// The `bytes` lowest bytes, the highest of them first.
std::string BigEndian(std::uint64_t bits, int bytes) {
  std::string encoded;
  for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8) {
    encoded += static_cast<char>(bits >> shift);
  }
  return encoded;
}

std::uint64_t FromBigEndian(std::string_view bytes) {
  std::uint64_t bits = 0;
  for (const char byte : bytes) {
    bits = bits << 8 | static_cast<unsigned char>(byte);
  }
  return bits;
}

template <typename T>
std::optional<std::string> EncodeInteger(std::int64_t value) {
  if (value < std::numeric_limits<T>::min() ||
      value > std::numeric_limits<T>::max()) {
    return std::nullopt;
  }
  return BigEndian(static_cast<std::uint64_t>(value), sizeof(T));
}

std::string EncodeDouble(double value) {
  return BigEndian(std::bit_cast<std::uint64_t>(value), sizeof value);
}

// nullopt if the type cannot hold the value.
std::optional<std::string> Encode(Oid type, std::int64_t value) {
  switch (type) {
    case kBool:
      return std::string(1, value != 0 ? '\1' : '\0');
    case kInt2:
      return EncodeInteger<std::int16_t>(value);
    case kInt4:
      return EncodeInteger<std::int32_t>(value);
    case kInt8:
      return EncodeInteger<std::int64_t>(value);
    case kFloat8:
      return EncodeDouble(static_cast<double>(value));
    default:
      return std::nullopt;
  }
}

std::optional<std::string> Encode(Oid type, double value) {
  if (type == kFloat8) return EncodeDouble(value);
  return std::nullopt;
}

// The bytes of a column of the row.
std::string_view Bytes(const PGresult* row, int column) {
  return {PQgetvalue(row, 0, column),
          static_cast<std::size_t>(PQgetlength(row, 0, column))};
}

std::int64_t DecodeInteger(Oid type, std::string_view bytes) {
  const std::uint64_t bits = FromBigEndian(bytes);
  switch (type) {
    case kInt2:
      return static_cast<std::int16_t>(bits);
    case kInt4:
      return static_cast<std::int32_t>(bits);
    default:
      return static_cast<std::int64_t>(bits);
  }
}

std::optional<double> DecodeReal(Oid type, std::string_view bytes) {
  const std::uint64_t bits = FromBigEndian(bytes);
  if (type == kFloat8) return std::bit_cast<double>(bits);
  if (type == kFloat4) {
    return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
  }
  return std::nullopt;
}

bool IsInteger(Oid type) {
  return type == kInt8 || type == kInt4 || type == kInt2 || type == kBool ||
         type == kOid;
}

}  // namespace

std::string WithDollarParameters(std::string_view sql) {
  std::string translated;
  bool quoted = false;
  for (const char c : sql) {
    if (c == '\'') quoted = !quoted;
    translated += c == '?' && !quoted ? '$' : c;
  }
  return translated;
}

absl::StatusOr<std::unique_ptr<PreparedStatement>> PostgresStatement::Prepare(
    PostgresConnection* connection, std::string_view sql) {
  connection->BeginCommand("");
  std::string name = connection->NewStatementName();
  const PostgresResult prepared(PQprepare(connection->handle(),
                                          name.c_str(),
                                          WithDollarParameters(sql).c_str(),
                                          0,
                                          nullptr));
  if (PQresultStatus(prepared.get()) != PGRES_COMMAND_OK) {
    return connection->ErrorOf(prepared.get(), sql);
  }
  const PostgresResult described(
      PQdescribePrepared(connection->handle(), name.c_str()));
  if (PQresultStatus(described.get()) != PGRES_COMMAND_OK) {
    return connection->ErrorOf(described.get(), sql);
  }
  std::vector<Oid> types(static_cast<std::size_t>(PQnparams(described.get())));
  for (std::size_t k = 0; k < types.size(); ++k) {
    types[k] = PQparamtype(described.get(), static_cast<int>(k));
  }
  return std::unique_ptr<PreparedStatement>(new PostgresStatement(
      connection, sql, std::move(name), std::move(types)));
}

PostgresStatement::~PostgresStatement() {
  Reset();
  connection_->Discard(name_);
}

absl::Status PostgresStatement::Bind(int index, Value value) {
  const auto place = static_cast<std::size_t>(index - 1);
  if (place >= values_.size()) {
    return absl::InternalError(
        fmt::format("there is no parameter ?{} in: {}", index, sql()));
  }
  values_[place] = std::move(value);
  return absl::OkStatus();
}

absl::Status PostgresStatement::BindInt(int index, std::int64_t value) {
  return Bind(index, value);
}

absl::Status PostgresStatement::BindDouble(int index, double value) {
  return std::isnan(value) ? Bind(index, Value()) : Bind(index, value);
}

absl::Status PostgresStatement::BindText(int index, std::string_view value) {
  return Bind(index, std::string(value));
}

absl::Status PostgresStatement::BindBlob(int index, std::string_view bytes) {
  return Bind(index, bytes);
}

absl::Status PostgresStatement::Send() {
  std::vector<std::string> encoded(values_.size());
  std::vector<const char*> pointers(values_.size(), nullptr);
  std::vector<int> lengths(values_.size(), 0);
  const std::vector<int> formats(values_.size(), kBinary);
  for (std::size_t k = 0; k < values_.size(); ++k) {
    std::string_view bytes;
    if (const auto* text = std::get_if<std::string>(&values_[k])) {
      bytes = *text;
    } else if (const auto* blob = std::get_if<std::string_view>(&values_[k])) {
      bytes = *blob;
    } else if (!std::holds_alternative<std::monostate>(values_[k])) {
      const auto* integer = std::get_if<std::int64_t>(&values_[k]);
      auto number = integer != nullptr
                        ? Encode(types_[k], *integer)
                        : Encode(types_[k], std::get<double>(values_[k]));
      if (!number) {
        return absl::InternalError(fmt::format(
            "parameter ?{} does not fit the type that the database gives it, "
            "in: {}",
            k + 1,
            sql()));
      }
      encoded[k] = *std::move(number);
      bytes = encoded[k];
    } else {
      continue;  // NULL
    }
    pointers[k] = bytes.data() == nullptr ? "" : bytes.data();
    lengths[k] = static_cast<int>(bytes.size());
  }
  connection_->BeginCommand(sql());
  if (PQsendQueryPrepared(connection_->handle(),
                          name_.c_str(),
                          static_cast<int>(values_.size()),
                          pointers.data(),
                          lengths.data(),
                          formats.data(),
                          kBinary) != 1) {
    return connection_->ErrorOf(nullptr, sql());
  }
  PQsetSingleRowMode(connection_->handle());
  connection_->SetStreaming(this);
  streaming_ = true;
  return absl::OkStatus();
}

PostgresResult PostgresStatement::Receive() {
  PostgresResult result(PQgetResult(connection_->handle()));
  const ExecStatusType status = PQresultStatus(result.get());
  if (status == PGRES_SINGLE_TUPLE) return result;
  if (status != PGRES_TUPLES_OK && status != PGRES_COMMAND_OK) {
    end_ = connection_->ErrorOf(result.get(), sql());
  } else if (sql() == "COMMIT") {
    end_ = connection_->CheckCommitted(result.get());
  }
  while (result != nullptr) {
    result.reset(PQgetResult(connection_->handle()));
  }
  streaming_ = false;
  connection_->SetStreaming(nullptr);
  return nullptr;
}

void PostgresStatement::BufferRest() {
  while (streaming_) {
    PostgresResult row = Receive();
    if (row != nullptr) buffered_.push_back(std::move(row));
  }
}

absl::StatusOr<bool> PostgresStatement::Step() {
  if (!running_) {
    SELFCAL_RETURN_IF_ERROR(Send());
    running_ = true;
  }
  row_.reset();
  if (!buffered_.empty()) {
    row_ = std::move(buffered_.front());
    buffered_.pop_front();
  } else if (streaming_) {
    row_ = Receive();
  }
  if (row_ != nullptr) return true;
  SELFCAL_RETURN_IF_ERROR(end_);
  return false;
}

std::int64_t PostgresStatement::Int(int column) const {
  if (IsNull(column)) return 0;
  const Oid type = PQftype(row_.get(), column);
  const std::string_view bytes = Bytes(row_.get(), column);
  if (IsInteger(type)) return DecodeInteger(type, bytes);
  return static_cast<std::int64_t>(DecodeReal(type, bytes).value_or(0));
}

double PostgresStatement::Double(int column) const {
  if (IsNull(column)) return 0;
  const Oid type = PQftype(row_.get(), column);
  const std::string_view bytes = Bytes(row_.get(), column);
  if (IsInteger(type)) return static_cast<double>(DecodeInteger(type, bytes));
  return DecodeReal(type, bytes).value_or(0);
}

std::string PostgresStatement::Text(int column) const {
  return std::string(Bytes(row_.get(), column));
}

bool PostgresStatement::IsNull(int column) const {
  return PQgetisnull(row_.get(), 0, column) == 1;
}

void PostgresStatement::Reset() {
  while (streaming_) Receive();
  buffered_.clear();
  row_.reset();
  end_ = absl::OkStatus();
  running_ = false;
  values_.assign(values_.size(), Value());
}

}  // namespace selfcal::server
