// Inspection of the file at a path without modifying it, and the operations on
// whole files that must survive a power failure. No SQL.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

namespace selfcal::server {

// "SCAL", the application id in the header of a database of this program.
inline constexpr std::int32_t kApplicationId = 0x5343414c;

enum class DatabaseFile { kAbsent, kOurs };

// Reads the header. FAILED_PRECONDITION for anything but a database of this
// program: a file of another kind, another program's database, an empty file,
// or a log without its database.
absl::StatusOr<DatabaseFile> InspectDatabaseFile(const std::string& path);

// Syncs `from`, renames it to `to` atomically, and syncs the folder.
absl::Status RenameDurably(const std::string& from, const std::string& to);

// Removes an unfinished database and its logs.
absl::Status RemoveDatabaseFiles(const std::string& path);

}  // namespace selfcal::server
