// Records of events: an append-only log.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

absl::Status AppendEvent(UnitOfWork* tx,
                         EventKind kind,
                         const std::string& detail);
// An event whose number is the next one of its rig, whatever it states.
// Returns the number.
absl::StatusOr<std::int64_t> InsertEvent(Connection* db,
                                         const StoredEvent& event);

// Writes an event that the device of the rig reports, unless it was written
// before. Its number is another one if the device's was given before: to an
// event of an earlier rig of this name, whose events stay.
absl::Status InsertReportedEvent(UnitOfWork* tx, const StoredEvent& event);

// Store::ListEvents and ListNewestEvents: of one rig by number, or of those of
// `of` by steady time if `rig` is empty.
absl::StatusOr<Listed<StoredEvent>> ListEventRows(Connection* db,
                                                  const Page& page,
                                                  const std::string& rig,
                                                  const RigQuery& of);
absl::StatusOr<Listed<StoredEvent>> ListNewestEventRows(Connection* db,
                                                        const Page& page,
                                                        const std::string& rig,
                                                        const RigQuery& of);

}  // namespace selfcal::server
