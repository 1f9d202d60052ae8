// A database that waits to take the place of the present one. No SQL but to
// check it.
//
// It arrives as <path>.restore.new, is verified, and gets the name
// <path>.restore-<time> in one durable step. From then on the next start
// carries the change through, whatever happens on the way: the present log and
// database are moved to <path>.before-restore-<time>, then the new one takes
// its name.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <atomic>
#include <memory>
#include <string>

#include "server/store/maintenance.h"

namespace selfcal::server {

// Before the database at `path` is opened: puts the one that waits in its
// place. OK if none does.
absl::Status TakeOverRestored(const std::string& path);

// `busy` is set while it lives.
absl::StatusOr<std::unique_ptr<Restoration>> BeginRestoration(
    const std::string& path, std::atomic<bool>* busy);

}  // namespace selfcal::server
