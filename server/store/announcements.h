// Announcements of a daemon to the others that share its database: something
// has been committed that they may have to pass on. One is a hint to read the
// records, and may come twice or late; the listener is told when one may have
// been lost.
#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "server/store/unit_of_work.h"

namespace selfcal::server {

struct Announcement {
  enum class Kind {
    kCalibration,  // the active version of the rig, or its verdict, is another
    kRun,          // a run was created, or its state has changed
    kDeletion,     // the rig was deleted
    kMissed,       // some announcements may have been missed
  };
  Kind kind = Kind::kMissed;
  std::string rig = {};
  std::int64_t run = 0;

  friend bool operator==(const Announcement&, const Announcement&) = default;
};

// Announces it when the unit of work is committed.
absl::Status AnnounceCalibration(UnitOfWork* tx);
absl::Status AnnounceRun(UnitOfWork* tx, std::int64_t run);
absl::Status AnnounceDeletion(UnitOfWork* tx);

// The announcement of a text of Database::Listen. nullopt if the program does
// not know it: a newer one has sent it.
std::optional<Announcement> ParseAnnouncement(
    const std::optional<std::string>& text);

}  // namespace selfcal::server
