// Segments in the database: metadata, data, information.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/store/payload.h"
#include "server/store/statement.h"
#include "server/store/store.h"
#include "server/store/store_options.h"

namespace selfcal::server {

struct SegmentRow {
  std::int64_t rowid = 0;
  std::int64_t sequence = 0;
  SegmentState state = SegmentState::kStored;
};

// "segment <session>~<index> of rig <rig>", for messages.
std::string SegmentText(const std::string& rig, const SegmentKey& key);

// What is written of a segment that was received.
struct NewSegment {
  SegmentKey key;
  std::int64_t calibration_version = 1;
  std::int64_t start_ns = 0;
  std::int64_t end_ns = 0;
  std::int64_t keyframes = 0;
  std::int64_t imu_samples = 0;
  std::int64_t landmarks = 0;
  std::int64_t observations = 0;
  std::optional<double> temperature_c;
  std::vector<PathPoint> path;
  Payload payload;
};

// Compresses: the larger part of the work, and needs no database.
absl::StatusOr<NewSegment> PackNewSegment(const MotionSegment& segment);

// In one transaction. NOT_FOUND for the rig; RESOURCE_EXHAUSTED by a quota.
absl::StatusOr<PutVerdict> PutSegmentRow(Connection* db,
                                         const std::string& rig,
                                         const NewSegment& segment,
                                         const Quotas& quotas);

// NOT_FOUND.
absl::StatusOr<SegmentRow> FindSegment(Connection* db,
                                       std::int64_t rig,
                                       const SegmentKey& key);

// DATA_LOSS if its information is damaged.
absl::StatusOr<StoredSegment> ReadSegment(Connection* db,
                                          const std::string& rig,
                                          const SegmentKey& key);

// Damaged information leaves a `problem` instead, so that one bad row does not
// hide the others.
absl::StatusOr<Listed<StoredSegment>> ListSegmentRows(Connection* db,
                                                      const std::string& rig,
                                                      const SegmentQuery& query,
                                                      const Page& page);

// FAILED_PRECONDITION if the data was dropped.
absl::StatusOr<Payload> ReadPayload(Connection* db,
                                    const std::string& rig,
                                    const SegmentKey& key);

absl::StatusOr<std::vector<Store::Unscored>> ListUnscoredRows(Connection* db,
                                                              int limit);

// The rest runs inside a transaction of the caller.

absl::StatusOr<bool> HasData(Connection* db, std::int64_t segment);

// Stored or scored -> scored, with its information and the scores of its
// groups, in place of earlier ones.
absl::Status WriteScore(Connection* db,
                        std::int64_t segment,
                        const SegmentInformation& information);

// Any state -> unusable.
absl::Status WriteProblem(Connection* db,
                          std::int64_t segment,
                          const std::string& problem);

// Drops the data of every segment of the rig that neither waits for its score
// nor is in a table or an unfinished run, nor is of the reserve for held-out
// tests: the newest Store::kReserve scored ones that no table holds, none from
// before the newest change of the device.
absl::Status DropUnreferencedPayloads(Connection* db, std::int64_t rig);

}  // namespace selfcal::server
