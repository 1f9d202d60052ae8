// The address of a PostgreSQL database, as libpq reads it:
// postgresql://user@host:5432/database?sslmode=verify-full. It may contain a
// password, which is never part of a message.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <string_view>

namespace selfcal::server {

// Whether `uri` has the scheme of PostgreSQL.
bool IsPostgresUri(std::string_view uri);

// The address for messages: user, hosts and database, without the parameters
// and without a password. INVALID_ARGUMENT, whose message contains nothing of
// `uri`, if libpq cannot read it.
absl::StatusOr<std::string> ShownUri(const std::string& uri);

}  // namespace selfcal::server
