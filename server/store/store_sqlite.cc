#include "server/store/store_sqlite.h"

#include <mutex>
#include <utility>

#include "migrations/migrations.h"
#include "server/store/calibrations.h"
#include "server/store/change_rows.h"
#include "server/store/changes.h"
#include "server/store/database.h"
#include "server/store/events.h"
#include "server/store/payload.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_rows.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

// Locks, and leaves the work to the files of each subject.
class SqliteStore : public Store {
 public:
  SqliteStore(Connection db, const ChangeOptions& change)
      : db_(std::move(db)), change_(change) {}

  absl::StatusOr<StoredRig> CreateRig(const Rig& rig,
                                      const RigPolicy& policy) override {
    const std::lock_guard lock(mutex_);
    return CreateRigRow(&db_, rig, policy);
  }

  absl::StatusOr<StoredRig> GetRig(const std::string& rig) override {
    const std::lock_guard lock(mutex_);
    SELFCAL_ASSIGN_OR_RETURN(RigRow row, ReadRig(&db_, rig));
    return std::move(row.stored);
  }

  absl::StatusOr<Listed<StoredRig>> ListRigs(const Page& page) override {
    const std::lock_guard lock(mutex_);
    return ListRigRows(&db_, page);
  }

  absl::StatusOr<PutVerdict> PutSegment(const std::string& rig,
                                        const MotionSegment& segment) override {
    // Compression is the larger part of the work, and needs no lock.
    SELFCAL_ASSIGN_OR_RETURN(const Payload payload, PackSegment(segment));
    const std::lock_guard lock(mutex_);
    return PutSegmentRow(&db_, rig, segment, payload);
  }

  absl::StatusOr<StoredSegment> GetSegment(const std::string& rig,
                                           const SegmentKey& key) override {
    const std::lock_guard lock(mutex_);
    return ReadSegment(&db_, rig, key);
  }

  absl::StatusOr<Listed<StoredSegment>> ListSegments(
      const std::string& rig, const Page& page) override {
    const std::lock_guard lock(mutex_);
    return ListSegmentRows(&db_, rig, page);
  }

  absl::StatusOr<MotionSegment> GetSegmentData(const std::string& rig,
                                               const SegmentKey& key) override {
    SELFCAL_ASSIGN_OR_RETURN(const Payload payload, LockedPayload(rig, key));
    return UnpackSegment(payload, SegmentText(rig, key));
  }

  absl::StatusOr<std::vector<Unscored>> ListUnscored(int limit) override {
    const std::lock_guard lock(mutex_);
    return ListUnscoredRows(&db_, limit);
  }

  absl::StatusOr<ScoreCommit> CommitScore(
      const std::string& rig,
      const SegmentKey& key,
      const SegmentInformation& information) override {
    const std::lock_guard lock(mutex_);
    return CommitScoreRows(&db_, rig, key, information, change_);
  }

  absl::Status MarkUnusable(const std::string& rig,
                            const SegmentKey& key,
                            const std::string& problem) override {
    const std::lock_guard lock(mutex_);
    return MarkUnusableRow(&db_, rig, key, problem);
  }

  absl::StatusOr<std::vector<Table>> GetTables(
      const std::string& rig) override {
    const std::lock_guard lock(mutex_);
    SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(&db_, rig));
    return ReadTables(&db_, rig_id);
  }

  absl::StatusOr<std::vector<SegmentInformation>> ListHeldOut(
      const std::string& rig, std::int64_t run, int limit) override {
    const std::lock_guard lock(mutex_);
    return ListHeldOutRows(&db_, rig, run, limit);
  }

  absl::StatusOr<StoredChange> GetChange(const std::string& rig,
                                         std::int64_t change) override {
    const std::lock_guard lock(mutex_);
    return ReadChange(&db_, rig, change);
  }

  absl::StatusOr<StoredCalibration> GetCalibration(
      const std::string& rig, std::int64_t version) override {
    const std::lock_guard lock(mutex_);
    return ReadCalibration(&db_, rig, version);
  }

  absl::StatusOr<StoredCalibration> GetActiveCalibration(
      const std::string& rig) override {
    const std::lock_guard lock(mutex_);
    return ReadActiveCalibration(&db_, rig);
  }

  absl::StatusOr<Listed<StoredCalibration>> ListCalibrations(
      const std::string& rig, const Page& page) override {
    const std::lock_guard lock(mutex_);
    return ListCalibrationRows(&db_, rig, page);
  }

  absl::StatusOr<StoredCalibration> ActivateCalibration(
      const std::string& rig,
      std::int64_t version,
      const std::string& caller,
      const std::string& reason) override {
    const std::lock_guard lock(mutex_);
    return ActivateCalibrationRow(&db_, rig, version, caller, reason);
  }

  absl::StatusOr<StoredRun> CreateManualRun(const std::string& rig) override {
    const std::lock_guard lock(mutex_);
    return CreateManualRunRow(&db_, rig);
  }

  absl::StatusOr<StoredRun> GetRun(const std::string& rig,
                                   std::int64_t run) override {
    const std::lock_guard lock(mutex_);
    return ReadRun(&db_, rig, run);
  }

  absl::StatusOr<Listed<StoredRun>> ListRuns(const std::string& rig,
                                             const Page& page) override {
    const std::lock_guard lock(mutex_);
    return ListRunRows(&db_, rig, page);
  }

  absl::StatusOr<std::vector<StoredRun>> ListUnfinishedRuns() override {
    const std::lock_guard lock(mutex_);
    return ListUnfinishedRunRows(&db_);
  }

  absl::StatusOr<std::vector<StoredRun>> StartAgedRuns(
      std::int64_t now_ns) override {
    const std::lock_guard lock(mutex_);
    return StartAgedRunRows(&db_, now_ns);
  }

  absl::Status HoldRun(const std::string& rig,
                       std::int64_t run,
                       const std::string& reason) override {
    const std::lock_guard lock(mutex_);
    return HoldRunRow(&db_, rig, run, reason);
  }

  absl::StatusOr<StoredRun> BeginRun(const std::string& rig,
                                     std::int64_t run) override {
    const std::lock_guard lock(mutex_);
    return BeginRunRow(&db_, rig, run);
  }

  absl::StatusOr<StoredRun> ReleaseRun(const std::string& rig,
                                       std::int64_t run) override {
    const std::lock_guard lock(mutex_);
    return ReleaseRunRow(&db_, rig, run);
  }

  absl::StatusOr<StoredCalibration> StoreCandidate(
      const std::string& rig,
      std::int64_t run,
      const StoredCalibration& calibration) override {
    const std::lock_guard lock(mutex_);
    return StoreCandidateRow(&db_, rig, run, calibration);
  }

  absl::StatusOr<StoredCalibration> GetCandidate(const std::string& rig,
                                                 std::int64_t run) override {
    const std::lock_guard lock(mutex_);
    return ReadCandidate(&db_, rig, run);
  }

  absl::StatusOr<StoredCalibration> FinishRun(
      const std::string& rig,
      std::int64_t run,
      const StoredCalibration& calibration) override {
    const std::lock_guard lock(mutex_);
    return FinishRunRow(&db_, rig, run, calibration);
  }

  absl::StatusOr<StoredRun> EndRun(const std::string& rig,
                                   std::int64_t run,
                                   RunState state,
                                   const std::string& message) override {
    const std::lock_guard lock(mutex_);
    return EndRunRow(&db_, rig, run, state, message);
  }

  absl::StatusOr<Listed<StoredEvent>> ListEvents(const Page& page) override {
    const std::lock_guard lock(mutex_);
    return ListEventRows(&db_, page);
  }

 private:
  absl::StatusOr<Payload> LockedPayload(const std::string& rig,
                                        const SegmentKey& key) {
    const std::lock_guard lock(mutex_);
    return ReadPayload(&db_, rig, key);
  }

  std::mutex mutex_;
  Connection db_;  // guarded by mutex_
  const ChangeOptions change_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Store>> MakeSqliteStore(
    const std::string& path, const ChangeOptions& change) {
  SELFCAL_ASSIGN_OR_RETURN(Connection db,
                           OpenDatabase(path, EmbeddedMigrations()));
  return std::unique_ptr<Store>(new SqliteStore(std::move(db), change));
}

}  // namespace selfcal::server
