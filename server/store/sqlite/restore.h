// A restored database that waits to replace the present one.
//
// It is received as <path>.restore.new, verified, and durably renamed to
// <path>.restore-<time>. From then on the next start completes the replacement,
// however often it is interrupted: it moves the present log and database to
// <path>.before-restore-<time> and then renames the new database to <path>.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <atomic>
#include <memory>
#include <string>

#include "server/store/driver/database_copies.h"

namespace selfcal::server {

// Replaces the database at `path` by the one that waits, if there is one. Call
// before the database is opened.
absl::Status TakeOverRestored(const std::string& path);

// FAILED_PRECONDITION if `busy`, which is true as long as the result lives, or
// if a restored database waits already.
absl::StatusOr<std::unique_ptr<ArrivingCopy>> BeginRestoration(
    const std::string& path, std::atomic<bool>* busy);

}  // namespace selfcal::server
