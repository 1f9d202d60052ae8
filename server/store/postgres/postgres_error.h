// Errors of PostgreSQL as canonical errors that say what to do.
#pragma once

#include <absl/status/status.h>

#include <string_view>

namespace selfcal::server {

// Two transactions changed the same records: running this one again succeeds
// (serialization_failure, deadlock_detected).
bool IsConflict(std::string_view sqlstate);

// The server closes the connection, or refuses to write because it has become a
// standby: another connection may reach a server that works.
bool EndsConnection(std::string_view sqlstate);

// `sqlstate` has five characters, `message` is the server's and `sql` the
// statement that failed.
absl::Status PostgresError(std::string_view sqlstate,
                           std::string_view message,
                           std::string_view sql);

// The connection was lost or could not be opened, with libpq's message.
// RESOURCE_EXHAUSTED if the server has too many connections, otherwise
// UNAVAILABLE.
absl::Status ConnectionError(std::string_view libpq_message);

}  // namespace selfcal::server
