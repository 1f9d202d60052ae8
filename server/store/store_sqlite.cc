#include "server/store/store_sqlite.h"

#include <future>
#include <memory>
#include <type_traits>
#include <utility>

#include "migrations/migrations.h"
#include "server/store/absences.h"
#include "server/store/calibrations.h"
#include "server/store/change_rows.h"
#include "server/store/changes.h"
#include "server/store/database.h"
#include "server/store/events.h"
#include "server/store/maintenance_sqlite.h"
#include "server/store/payload.h"
#include "server/store/quotas.h"
#include "server/store/restore.h"
#include "server/store/rig_summaries.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_ends.h"
#include "server/store/segment_rows.h"
#include "server/store/session_rows.h"
#include "server/store/shared_database.h"
#include "server/store/status_macros.h"
#include "server/store/table_rows.h"

namespace selfcal::server {
namespace {

// Gives the work of each subject its connection.
class SqliteStore : public Store {
 public:
  SqliteStore(const std::string& path,
              std::unique_ptr<SharedDatabase> db,
              const StoreOptions& options)
      : options_(options),
        maintenance_(MakeSqliteMaintenance(path)),
        db_(std::move(db)) {}

  absl::StatusOr<StoredRig> CreateRig(const Rig& rig,
                                      const RigPolicy& policy) override {
    return Write([&](Connection* db) { return CreateRigRow(db, rig, policy); });
  }

  absl::StatusOr<StoredRig> GetRig(const std::string& rig) override {
    return Read([&](Connection* db) -> absl::StatusOr<StoredRig> {
      SELFCAL_ASSIGN_OR_RETURN(RigRow row, ReadRig(db, rig));
      return std::move(row.stored);
    });
  }

  absl::StatusOr<Listed<StoredRig>> ListRigs(const Page& page) override {
    return Read([&](Connection* db) { return ListRigRows(db, page); });
  }

  absl::StatusOr<Listed<RigSummary>> ListRigSummaries(
      const RigQuery& query, const Page& page) override {
    return Read(
        [&](Connection* db) { return ListSummaryRows(db, query, page); });
  }

  absl::StatusOr<PutVerdict> PutSegment(const std::string& rig,
                                        const MotionSegment& segment) override {
    const auto verdict =
        std::make_shared<std::promise<absl::StatusOr<PutVerdict>>>();
    BeginPutSegment(rig, segment, [verdict](const auto& answer) {
      verdict->set_value(answer);
    });
    return verdict->get_future().get();
  }

  void BeginPutSegment(const std::string& rig,
                       const MotionSegment& segment,
                       PutDone done) override {
    auto packed = PackNewSegment(segment);
    if (!packed.ok()) return done(packed.status());
    // Shared by the change and by what is told of it.
    struct Put {
      std::string rig;
      NewSegment segment;
      PutVerdict verdict;
    };
    const auto put =
        std::make_shared<Put>(Put{rig, *std::move(packed), PutVerdict()});
    db_->Write(
        [put, quotas = options_.quotas](Connection* db) {
          const auto verdict =
              PutSegmentRow(db, put->rig, put->segment, quotas);
          put->verdict = verdict.value_or(PutVerdict());
          return verdict.status();
        },
        [put, done = std::move(done)](const absl::Status& status) {
          if (status.ok()) {
            done(put->verdict);
          } else {
            done(status);
          }
        });
  }

  absl::StatusOr<StoredSegment> GetSegment(const std::string& rig,
                                           const SegmentKey& key) override {
    return Read([&](Connection* db) { return ReadSegment(db, rig, key); });
  }

  using Store::ListSegments;
  absl::StatusOr<Listed<StoredSegment>> ListSegments(
      const std::string& rig,
      const SegmentQuery& query,
      const Page& page) override {
    return Read(
        [&](Connection* db) { return ListSegmentRows(db, rig, query, page); });
  }

  absl::StatusOr<MotionSegment> GetSegmentData(const std::string& rig,
                                               const SegmentKey& key) override {
    SELFCAL_ASSIGN_OR_RETURN(const Payload payload, Read([&](Connection* db) {
                               return ReadPayload(db, rig, key);
                             }));
    return UnpackSegment(payload, SegmentText(rig, key));
  }

  absl::StatusOr<Listed<SessionSummary>> ListSessions(
      const std::string& rig, const Page& page) override {
    return Read([&](Connection* db) { return ListSessionRows(db, rig, page); });
  }

  absl::StatusOr<Listed<SessionSegment>> ListSessionSegments(
      const std::string& rig,
      const std::string& session,
      const Page& page) override {
    return Read([&](Connection* db) {
      return ListSessionSegmentRows(db, rig, session, page);
    });
  }

  absl::StatusOr<SessionSummary> GetSession(
      const std::string& rig, const std::string& session) override {
    return Read([&](Connection* db) { return ReadSession(db, rig, session); });
  }

  absl::StatusOr<std::vector<TableAbsence>> ListAbsences(
      const std::string& rig, const SegmentKey& key) override {
    return Read([&](Connection* db) { return ListAbsenceRows(db, rig, key); });
  }

  absl::StatusOr<std::vector<Unscored>> ListUnscored(int limit) override {
    return Read([&](Connection* db) { return ListUnscoredRows(db, limit); });
  }

  absl::StatusOr<ScoreCommit> CommitScore(
      const std::string& rig,
      const SegmentKey& key,
      const SegmentInformation& information,
      const std::optional<SegmentEnds>& ends) override {
    return Write([&](Connection* db) {
      return CommitScoreRows(db, rig, key, information, ends, options_.change);
    });
  }

  absl::Status ReplaceScore(const std::string& rig,
                            const SegmentKey& key,
                            const SegmentInformation& information,
                            const SegmentEnds& ends) override {
    return Write([&](Connection* db) {
      return ReplaceScoreRows(db, rig, key, information, ends);
    });
  }

  absl::StatusOr<std::vector<RememberedSegment>> ListRemembered(
      const std::string& rig, std::int64_t run) override {
    return Read(
        [&](Connection* db) { return ListRememberedRows(db, rig, run); });
  }

  absl::Status MarkUnusable(const std::string& rig,
                            const SegmentKey& key,
                            const std::string& problem) override {
    return Write(
        [&](Connection* db) { return MarkUnusableRow(db, rig, key, problem); });
  }

  absl::StatusOr<QuarantineCommit> QuarantineSegments(
      const std::string& rig,
      const std::string& session,
      std::optional<std::int64_t> index,
      const std::string& caller,
      const std::string& reason) override {
    return Write([&](Connection* db) {
      return QuarantineSegmentRows(db, rig, session, index, caller, reason);
    });
  }

  absl::StatusOr<std::vector<Table>> GetTables(
      const std::string& rig) override {
    return Read([&](Connection* db) -> absl::StatusOr<std::vector<Table>> {
      SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
      return ReadTables(db, rig_id);
    });
  }

  absl::StatusOr<std::vector<HeldOut>> ListHeldOut(const std::string& rig,
                                                   std::int64_t run,
                                                   int limit) override {
    return Read(
        [&](Connection* db) { return ListHeldOutRows(db, rig, run, limit); });
  }

  absl::StatusOr<StoredChange> GetChange(const std::string& rig,
                                         std::int64_t change) override {
    return Read([&](Connection* db) { return ReadChange(db, rig, change); });
  }

  absl::StatusOr<StoredCalibration> GetCalibration(
      const std::string& rig, std::int64_t version) override {
    return Read(
        [&](Connection* db) { return ReadCalibration(db, rig, version); });
  }

  absl::StatusOr<StoredCalibration> GetActiveCalibration(
      const std::string& rig) override {
    return Read([&](Connection* db) { return ReadActiveCalibration(db, rig); });
  }

  absl::StatusOr<Listed<StoredCalibration>> ListCalibrations(
      const std::string& rig, const Page& page) override {
    return Read(
        [&](Connection* db) { return ListCalibrationRows(db, rig, page); });
  }

  absl::StatusOr<StoredCalibration> ActivateCalibration(
      const std::string& rig,
      std::int64_t version,
      const std::string& caller,
      const std::string& reason) override {
    return Write([&](Connection* db) {
      return ActivateCalibrationRow(db, rig, version, caller, reason);
    });
  }

  absl::Status ReportDisagreement(const std::string& rig,
                                  std::int64_t version,
                                  const std::string& finding) override {
    return Write([&](Connection* db) {
      return ReportDisagreementRow(db, rig, version, finding);
    });
  }

  using Store::CreateManualRun;
  absl::StatusOr<StoredRun> CreateManualRun(const std::string& rig,
                                            bool force) override {
    return Write(
        [&](Connection* db) { return CreateManualRunRow(db, rig, force); });
  }

  absl::StatusOr<StoredRun> GetRun(const std::string& rig,
                                   std::int64_t run) override {
    return Read([&](Connection* db) { return ReadRun(db, rig, run); });
  }

  absl::StatusOr<Listed<StoredRun>> ListRuns(const std::string& rig,
                                             const Page& page) override {
    return Read([&](Connection* db) { return ListRunRows(db, rig, page); });
  }

  absl::StatusOr<std::vector<StoredRun>> ListUnfinishedRuns() override {
    return Read([&](Connection* db) { return ListUnfinishedRunRows(db); });
  }

  absl::StatusOr<std::vector<StoredRun>> StartAgedRuns(
      std::int64_t now_ns) override {
    return Write([&](Connection* db) { return StartAgedRunRows(db, now_ns); });
  }

  absl::StatusOr<std::vector<StoredRun>> StartSessionRuns(
      const std::vector<std::string>& ended,
      std::int64_t idle_since_ns) override {
    return Write([&](Connection* db) {
      return StartSessionRunRows(db, ended, idle_since_ns);
    });
  }

  absl::Status HoldRun(const std::string& rig,
                       std::int64_t run,
                       const std::string& reason) override {
    return Write(
        [&](Connection* db) { return HoldRunRow(db, rig, run, reason); });
  }

  absl::StatusOr<StoredRun> BeginRun(const std::string& rig,
                                     std::int64_t run) override {
    return Write([&](Connection* db) { return BeginRunRow(db, rig, run); });
  }

  absl::StatusOr<StoredRun> ReleaseRun(const std::string& rig,
                                       std::int64_t run) override {
    return Write([&](Connection* db) { return ReleaseRunRow(db, rig, run); });
  }

  absl::StatusOr<StoredCalibration> StoreCandidate(
      const std::string& rig,
      std::int64_t run,
      const StoredCalibration& calibration) override {
    return Write([&](Connection* db) {
      return StoreCandidateRow(db, rig, run, calibration);
    });
  }

  absl::StatusOr<StoredCalibration> GetCandidate(const std::string& rig,
                                                 std::int64_t run) override {
    return Read([&](Connection* db) { return ReadCandidate(db, rig, run); });
  }

  absl::StatusOr<StoredCalibration> FinishRun(
      const std::string& rig,
      std::int64_t run,
      const StoredCalibration& calibration) override {
    return Write([&](Connection* db) {
      return FinishRunRow(db, rig, run, calibration, options_.change);
    });
  }

  absl::StatusOr<StoredRun> EndRun(const std::string& rig,
                                   std::int64_t run,
                                   RunState state,
                                   const std::string& message) override {
    return Write([&](Connection* db) {
      return EndRunRow(db, rig, run, state, message);
    });
  }

  absl::StatusOr<Listed<StoredEvent>> ListEvents(
      const Page& page, const std::string& rig) override {
    return Read([&](Connection* db) { return ListEventRows(db, page, rig); });
  }

  absl::StatusOr<Listed<StoredEvent>> ListNewestEvents(
      const Page& page, const std::string& rig) override {
    return Read(
        [&](Connection* db) { return ListNewestEventRows(db, page, rig); });
  }

  StoreMaintenance* maintenance() override { return maintenance_.get(); }

 private:
  // `query` returns a Status or a StatusOr of what it has read.
  template <typename Query>
  auto Read(const Query& query) -> std::invoke_result_t<Query, Connection*> {
    std::invoke_result_t<Query, Connection*> result = absl::UnknownError("");
    const absl::Status status = db_->Read([&](Connection* db) {
      result = query(db);
      return StatusOf(result);
    });
    SELFCAL_RETURN_IF_ERROR(status);
    return result;
  }

  template <typename Change>
  auto Write(const Change& change)
      -> std::invoke_result_t<Change, Connection*> {
    std::invoke_result_t<Change, Connection*> result = absl::UnknownError("");
    const absl::Status status = db_->Write([&](Connection* db) {
      result = change(db);
      return StatusOf(result);
    });
    SELFCAL_RETURN_IF_ERROR(status);
    return result;
  }

  static absl::Status StatusOf(const absl::Status& status) { return status; }
  template <typename T>
  static absl::Status StatusOf(const absl::StatusOr<T>& result) {
    return result.status();
  }

  const StoreOptions options_;
  const std::unique_ptr<StoreMaintenance> maintenance_;
  const std::unique_ptr<SharedDatabase> db_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Store>> MakeSqliteStore(
    const std::string& path, const StoreOptions& options) {
  SELFCAL_RETURN_IF_ERROR(TakeOverRestored(path));
  const auto open = [path,
                     quotas = options.quotas]() -> absl::StatusOr<Connection> {
    SELFCAL_ASSIGN_OR_RETURN(Connection db,
                             OpenDatabase(path, EmbeddedMigrations()));
    SELFCAL_RETURN_IF_ERROR(LimitDatabase(&db, quotas));
    return db;
  };
  SELFCAL_ASSIGN_OR_RETURN(std::unique_ptr<SharedDatabase> db,
                           SharedDatabase::Open(path, open));
  return std::unique_ptr<Store>(new SqliteStore(path, std::move(db), options));
}

}  // namespace selfcal::server
