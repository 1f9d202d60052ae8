#include "server/store/postgres/postgres_error.h"

#include <fmt/format.h>

#include <string>

namespace selfcal::server {
namespace {

constexpr std::size_t kShownSql = 120;

struct Meaning {
  std::string_view prefix;  // of the SQLSTATE
  absl::StatusCode code;
  std::string_view advice;
};

// The first prefix that fits.
// https://www.postgresql.org/docs/current/errcodes-appendix.html
constexpr Meaning kMeanings[] = {
    {"53100",
     absl::StatusCode::kResourceExhausted,
     "the disk of the database is full: free some space and try again; nothing "
     "was changed"},
    {"53200",
     absl::StatusCode::kResourceExhausted,
     "memory of the database server is short: try again later; nothing was "
     "changed"},
    {"53300",
     absl::StatusCode::kResourceExhausted,
     "the database server has too many connections: raise its max_connections, "
     "or end some; nothing was changed"},
    {"53",
     absl::StatusCode::kResourceExhausted,
     "a limit of the database server is reached: try again later, or raise it; "
     "nothing was changed"},
    {"XX001",
     absl::StatusCode::kDataLoss,
     "the database is damaged: stop the daemon, keep a copy, and restore a "
     "backup"},
    {"XX002",
     absl::StatusCode::kDataLoss,
     "an index of the database is damaged: rebuild it with REINDEX, and check "
     "the disk"},
    {"40",
     absl::StatusCode::kUnavailable,
     "other transactions kept changing the same records: try again; nothing "
     "was "
     "changed"},
    {"08",
     absl::StatusCode::kUnavailable,
     "the connection to the database failed: check the server and the network"},
    {"25006",
     absl::StatusCode::kUnavailable,
     "the database server is a standby, or only lets read: try again once a "
     "primary is there; nothing was changed"},
    {"25P03",
     absl::StatusCode::kUnavailable,
     "the database server ended a transaction that was idle for too long: try "
     "again; nothing was changed"},
    {"55P03",
     absl::StatusCode::kUnavailable,
     "another transaction holds the records for too long: try again; nothing "
     "was changed"},
    {"57014",
     absl::StatusCode::kUnavailable,
     "the database server cancelled the statement, which took too long: ask "
     "for "
     "less, such as the rigs of one label, and try again; nothing was changed"},
    {"57",
     absl::StatusCode::kUnavailable,
     "the database server is stopping or starting: try again"},
    {"58",
     absl::StatusCode::kUnavailable,
     "the disk of the database server failed: check it and the server's log; "
     "nothing was changed"},
    {"42501",
     absl::StatusCode::kFailedPrecondition,
     "the user of the database lacks a right: make it the owner of the "
     "database"},
};

// Messages of libpq have several lines, each for one host or a hint.
std::string OnOneLine(std::string_view message) {
  std::string line;
  for (const char c : message) {
    const bool blank = c == '\n' || c == '\t' || c == ' ';
    if (!blank) {
      line += c;
    } else if (!line.ends_with(' ')) {
      line += ' ';
    }
  }
  while (line.ends_with(' ')) line.pop_back();
  return line;
}

}  // namespace

bool IsConflict(std::string_view sqlstate) {
  return sqlstate == "40001" || sqlstate == "40P01";
}

bool EndsConnection(std::string_view sqlstate) {
  return sqlstate.starts_with("08") || sqlstate.starts_with("57P") ||
         sqlstate == "25P03" || sqlstate == "25006";
}

absl::Status PostgresError(std::string_view sqlstate,
                           std::string_view message,
                           std::string_view sql) {
  absl::StatusCode code = absl::StatusCode::kInternal;
  std::string_view advice = "this is a defect of the program: please report it";
  for (const Meaning& meaning : kMeanings) {
    if (!sqlstate.starts_with(meaning.prefix)) continue;
    code = meaning.code;
    advice = meaning.advice;
    break;
  }
  return absl::Status(code,
                      fmt::format("{} (PostgreSQL {}: {}; at: {})",
                                  advice,
                                  sqlstate,
                                  message,
                                  sql.substr(0, kShownSql)));
}

absl::Status ConnectionError(std::string_view libpq_message) {
  const std::string message = OnOneLine(libpq_message);
  // libpq passes on no SQLSTATE of a server that refuses a connection.
  for (const std::string_view words :
       {"too many clients", "too many connections", "connection slots are"}) {
    if (message.find(words) != std::string::npos) {
      return PostgresError("53300", message, "connect");
    }
  }
  return PostgresError("08006", message, "connect");
}

}  // namespace selfcal::server
