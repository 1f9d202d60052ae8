#include "client/recording/sqlite_bag.h"

#include <absl/status/status.h>
#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <map>
#include <utility>

#include "client/recording/damage.h"
#include "client/recording/decompress.h"

namespace selfcal::client {
namespace {

struct Close {
  void operator()(sqlite3* database) const { sqlite3_close(database); }
  void operator()(sqlite3_stmt* statement) const {
    sqlite3_finalize(statement);
  }
  void operator()(sqlite3_blob* blob) const { sqlite3_blob_close(blob); }
};
template <typename T>
using Owned = std::unique_ptr<T, Close>;

class SqliteBag : public MessageFile {
 public:
  SqliteBag(std::string path, Owned<sqlite3> database)
      : path_(std::move(path)), database_(std::move(database)) {}

  absl::Status Scan(const Visitor& visit,
                    std::vector<std::string>* problems) override {
    std::map<std::int64_t, MessageTopic> topics;
    absl::Status read =
        Query("SELECT id, name, type, serialization_format FROM topics",
              [&](sqlite3_stmt* row) {
                if (Text(row, 3) != "cdr") return;
                topics[sqlite3_column_int64(row, 0)] = {
                    Text(row, 1), RosTypeName(Text(row, 2)), Wire::kCdr};
              });
    if (!read.ok()) return read;
    // The length of a blob is read without the blob.
    std::int64_t messages = 0;
    read = Query(
        "SELECT rowid, topic_id, length(data) FROM messages",
        [&](sqlite3_stmt* row) {
          ++messages;
          const auto topic = topics.find(sqlite3_column_int64(row, 1));
          const std::int64_t size = sqlite3_column_int64(row, 2);
          if (topic == topics.end() || size < 0 ||
              size > static_cast<std::int64_t>(kMaxChunkBytes)) {
            return;
          }
          visit(topic->second,
                {-1,
                 static_cast<std::uint32_t>(size),
                 static_cast<std::uint64_t>(sqlite3_column_int64(row, 0))});
        });
    if (!read.ok()) {
      problems->push_back(fmt::format("{}; not read after {} messages",
                                      std::string(read.message()),
                                      messages));
    }
    return absl::OkStatus();
  }

  absl::StatusOr<std::string_view> Read(const MessagePlace& place,
                                        std::size_t max_size) override {
    const auto row = static_cast<sqlite3_int64>(place.offset);
    // A blob that could not be moved is of no use any more.
    if (blob_ == nullptr ||
        sqlite3_blob_reopen(blob_.get(), row) != SQLITE_OK) {
      blob_.reset();
      sqlite3_blob* blob = nullptr;
      const int code = sqlite3_blob_open(
          database_.get(), "main", "messages", "data", row, 0, &blob);
      blob_.reset(blob);
      if (code != SQLITE_OK) return Failure();
    }
    const std::size_t size = std::min<std::size_t>(place.size, max_size);
    if (sqlite3_blob_bytes(blob_.get()) < static_cast<int>(size)) {
      return absl::DataLossError("the database is damaged");
    }
    buffer_.resize(size);
    if (sqlite3_blob_read(
            blob_.get(), buffer_.data(), static_cast<int>(size), 0) !=
        SQLITE_OK) {
      return Failure();
    }
    return buffer_;
  }

 private:
  absl::Status Failure() const {
    return absl::DataLossError(sqlite3_errmsg(database_.get()));
  }

  // Calls read(statement) for each row. Errors have the path.
  template <typename F>
  absl::Status Query(const char* sql, F read) {
    sqlite3_stmt* prepared = nullptr;
    int code = sqlite3_prepare_v2(database_.get(), sql, -1, &prepared, nullptr);
    const Owned<sqlite3_stmt> statement(prepared);
    while (code == SQLITE_OK || code == SQLITE_ROW) {
      code = sqlite3_step(statement.get());
      if (code == SQLITE_ROW) read(statement.get());
    }
    if (code == SQLITE_DONE) return absl::OkStatus();
    return absl::DataLossError(
        fmt::format("{}: SQLite: {}", path_, sqlite3_errmsg(database_.get())));
  }

  static std::string Text(sqlite3_stmt* row, int column) {
    const unsigned char* text = sqlite3_column_text(row, column);
    return text == nullptr ? std::string()
                           : reinterpret_cast<const char*>(text);
  }

  const std::string path_;
  const Owned<sqlite3> database_;
  Owned<sqlite3_blob> blob_;  // closed before the database
  std::string buffer_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<MessageFile>> OpenSqliteBag(
    const std::string& path) {
  sqlite3* opened = nullptr;
  const int code = sqlite3_open_v2(path.c_str(),
                                   &opened,
                                   SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX,
                                   nullptr);
  Owned<sqlite3> database(opened);
  if (code != SQLITE_OK) {
    return absl::DataLossError(
        fmt::format("{}: SQLite: {}", path, sqlite3_errstr(code)));
  }
  // Files of unknown origin: https://sqlite.org/security.html.
  sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(opened, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_exec(
      opened, "PRAGMA cell_size_check = ON", nullptr, nullptr, nullptr);
  sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, static_cast<int>(kMaxChunkBytes));
  return std::make_unique<SqliteBag>(path, std::move(database));
}

}  // namespace selfcal::client
