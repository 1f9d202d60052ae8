// Records of segments: metadata, data, information.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/model/motion_statistics.h"
#include "server/store/exclusions.h"
#include "server/store/payload.h"
#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

struct SegmentRow {
  SegmentKey key;
  // Order of arrival in the rig, from 1. The functions below take it as the
  // number of a segment.
  std::int64_t sequence = 0;
  SegmentState state = SegmentState::kStored;
  std::int64_t receive_steady_ns = 0;  // when it arrived, by steady time
  double fit = 0;  // ResidualStatistics::fit; 0: not measured
  std::optional<double> temperature_c = std::nullopt;  // of the device
};

// "segment <session>~<index> of rig <rig>", for messages.
std::string SegmentText(const std::string& rig, const SegmentKey& key);
// DATA_LOSS: `what` is intact, but that of another segment. A file whose tree
// is damaged may lead to the wrong row.
absl::Status OfAnotherSegment(const std::string& what,
                              const std::string& other_rig,
                              const SegmentKey& other);

// The record of a segment that was received.
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
  MotionStatistics motion;
  std::vector<PathPoint> path;
  Payload payload;
};

// Compresses the data, which is most of the work; needs no database.
absl::StatusOr<NewSegment> PackNewSegment(const MotionSegment& segment);

// DATA_LOSS if its information is damaged.
absl::StatusOr<StoredSegment> ReadSegment(Connection* db,
                                          const std::string& rig,
                                          const SegmentKey& key);

// Store::ListSegments. A segment with damaged information is listed with a
// `problem`, so that one damaged row does not hide the others.
absl::StatusOr<Listed<StoredSegment>> ListSegmentRows(Connection* db,
                                                      const std::string& rig,
                                                      const SegmentQuery& query,
                                                      const Page& page,
                                                      const RigQuery& of);

// FAILED_PRECONDITION if the data was dropped.
absl::StatusOr<Payload> ReadPayload(Connection* db,
                                    const std::string& rig,
                                    const SegmentKey& key);

// Store::ListUnscored.
absl::StatusOr<std::vector<Store::Unscored>> ListUnscoredRows(
    Connection* db, int of_each_rig, const std::string& replica);
// Store::CountUnscored.
absl::StatusOr<std::int64_t> CountUnscoredRows(Connection* db,
                                               const std::string& rig);

// --- Within a unit of work.

// NOT_FOUND.
absl::StatusOr<SegmentRow> FindSegment(UnitOfWork* tx, const SegmentKey& key);
absl::StatusOr<StoredSegment> ReadSegment(UnitOfWork* tx,
                                          const SegmentKey& key);
// All segments of a session in order of arrival, or the one with this index.
absl::StatusOr<std::vector<SegmentRow>> SegmentsOfSession(
    UnitOfWork* tx,
    const std::string& session,
    std::optional<std::int64_t> index);
// The segments in the tables, each once, in order of arrival.
absl::StatusOr<std::vector<SegmentRow>> SegmentsInTables(UnitOfWork* tx);
// True if a segment of the rig waits for its score.
absl::StatusOr<bool> HasUnscored(UnitOfWork* tx);
absl::StatusOr<std::int64_t> CountUnscored(UnitOfWork* tx);
absl::StatusOr<std::int64_t> CountScored(UnitOfWork* tx,
                                         std::int64_t first_sequence);
// 0 if there are none.
absl::StatusOr<std::int64_t> NewestSequence(UnitOfWork* tx);
// Steady time (Moment) at which the newest segment arrived; 0 if there are
// none.
absl::StatusOr<std::int64_t> NewestArrival(UnitOfWork* tx);
// Fits of the newest scored segments.
absl::StatusOr<std::vector<double>> NewestFits(UnitOfWork* tx, int limit);
// Segments that are not waiting for their score and that no table, run or
// calibration references; oldest first.
absl::StatusOr<std::vector<SegmentRow>> UnreferencedSegments(UnitOfWork* tx,
                                                             int limit);

// Selects the scored segments to visit.
struct ScoredFilter {
  std::int64_t first_sequence = 1;
  // Leaves out those in the snapshot of this run, and those used for this
  // version; 0 for none.
  std::int64_t not_in_run = 0;
  std::int64_t not_in_version = 0;
  bool with_data_first = false;  // both parts newest first
  int limit = 0;
  // Leaves out those that a table does not hold for one of these causes.
  ExclusionCauses not_excluded_for = {};
};
struct ScoredSegment {
  SegmentRow segment;
  bool has_data = false;
  absl::StatusOr<SegmentInformation> information;  // DATA_LOSS if damaged
};
// Calls `visit` with these segments until it returns false.
absl::Status VisitScored(
    UnitOfWork* tx,
    const ScoredFilter& filter,
    const std::function<bool(const ScoredSegment&)>& visit);

// A segment whose data is kept and that is not waiting for its score.
struct DataHolder {
  SegmentRow segment;
  std::int64_t bytes = 0;  // compressed
  bool in_unfinished_run = false;
  // The largest gain in the tables that hold it; nullopt if none does.
  std::optional<double> gain;
  bool excluded = false;   // from a table, for one of the causes asked for
  bool to_report = false;  // it stays until it was reported to the hub
};
// In order of arrival.
absl::StatusOr<std::vector<DataHolder>> DataHolders(
    UnitOfWork* tx, ExclusionCauses excluded_for = {});
// Bytes of the data of all segments, compressed.
absl::StatusOr<std::int64_t> DataBytes(UnitOfWork* tx);
absl::StatusOr<bool> HasData(UnitOfWork* tx, std::int64_t sequence);
absl::Status DeleteData(UnitOfWork* tx, std::int64_t sequence);

// Inserts a segment that waits for its score. The key must be new.
// Returns its sequence.
absl::StatusOr<std::int64_t> InsertSegment(UnitOfWork* tx,
                                           const NewSegment& segment);
// Stored or scored -> scored, with its information and the scores of its
// groups; replaces earlier ones.
absl::Status WriteScore(UnitOfWork* tx,
                        const SegmentRow& segment,
                        const SegmentInformation& information);
// Any state -> unusable.
absl::Status WriteUnusable(UnitOfWork* tx,
                           std::int64_t sequence,
                           const std::string& problem);
// Records why its data is gone.
absl::Status WriteProblem(UnitOfWork* tx,
                          std::int64_t sequence,
                          const std::string& problem);
// Who refers to a segment, so that it cannot be deleted.
struct SegmentUsers {
  std::optional<std::int64_t> version;         // the newest computed from it
  std::optional<std::int64_t> unfinished_run;  // that has it in its snapshot
};
absl::StatusOr<SegmentUsers> UsersOf(UnitOfWork* tx, std::int64_t sequence);
// All that is known of it; it leaves the snapshots of runs that have ended, and
// tables. Neither a calibration nor an unfinished run may refer to it.
absl::Status DeleteSegment(UnitOfWork* tx, std::int64_t sequence);
// The same for a segment that its device has deleted: the device reports what
// this changed in the records of other segments.
absl::Status DeleteSegmentAlone(UnitOfWork* tx, std::int64_t sequence);

}  // namespace selfcal::server
