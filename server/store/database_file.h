// What lies at a path, found out without touching it, and the few operations on
// whole files that must survive a power cut. No SQL.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

namespace selfcal::server {

// "SCAL": says in the header of the file whose it is.
inline constexpr std::int32_t kApplicationId = 0x5343414c;

enum class DatabaseFile { kAbsent, kOurs };

// Reads the header. FAILED_PRECONDITION for anything else than a database of
// this program: another file, another program's database, an empty file, the
// log of a database that is not there.
absl::StatusOr<DatabaseFile> InspectDatabaseFile(const std::string& path);

// Syncs `from` and its folder, and gives it the name `to`, at once or not at
// all.
absl::Status RenameDurably(const std::string& from, const std::string& to);

// Removes a database that was never finished, and its logs.
absl::Status RemoveDatabaseFiles(const std::string& path);

}  // namespace selfcal::server
