#include "server/store/make_store.h"

#include <memory>
#include <type_traits>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/announcements.h"
#include "server/store/calibrations.h"
#include "server/store/change_rows.h"
#include "server/store/clock_record.h"
#include "server/store/cohorts.h"
#include "server/store/driver/transaction.h"
#include "server/store/estimates.h"
#include "server/store/events.h"
#include "server/store/exclusions.h"
#include "server/store/instructions.h"
#include "server/store/maintenance.h"
#include "server/store/outbox.h"
#include "server/store/payload.h"
#include "server/store/replicas.h"
#include "server/store/report_check.h"
#include "server/store/reporting_device.h"
#include "server/store/rig_lists.h"
#include "server/store/rig_work.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_rows.h"
#include "server/store/session_rows.h"
#include "server/store/table_rows.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {
namespace {

// Runs the record functions of each subject on the right connection.
class DatabaseStore final : public Store {
 public:
  explicit DatabaseStore(std::unique_ptr<Database> db)
      : db_(std::move(db)),
        replicas_(MakeReplicas(db_.get())),
        outbox_(MakeOutbox(db_.get())),
        maintenance_(MakeMaintenance(db_.get())) {}

  absl::Status Transact(const RigClaim& claim,
                        const Moment& now,
                        const Work& work) override {
    return db_->Write(
        [&](Connection* db) { return CarryOut(db, claim, now, work); });
  }

  void BeginTransaction(const std::string& rig,
                        const Moment& now,
                        Work work,
                        Done done) override {
    db_->BeginWrite(
        [rig, now, work = std::move(work)](Connection* db) {
          return CarryOut(db, rig, now, work);
        },
        std::move(done));
  }

  absl::Status InsertRig(const StoredRig& rig,
                         const Moment& now,
                         const Work& work) override {
    return WriteInTransaction(db_.get(), [&](Connection* db) -> absl::Status {
      SELFCAL_ASSIGN_OR_RETURN(const std::int64_t row,
                               server::InsertRig(db, rig));
      UnitOfWork tx(db, rig.rig.id, row, now);
      SELFCAL_RETURN_IF_ERROR(work(&tx));
      return NoteChanges(&tx);
    });
  }

  absl::Status Inspect(const std::string& rig, const Work& work) override {
    return db_->Read([&](Connection* db) -> absl::Status {
      SELFCAL_ASSIGN_OR_RETURN(const std::int64_t row, FindRigId(db, rig));
      UnitOfWork tx(db, rig, row, 0);
      return work(&tx);
    });
  }

  absl::StatusOr<StoredRig> GetRig(const std::string& rig) override {
    return ReadOne([&](Connection* db) { return ReadRig(db, rig); });
  }

  absl::StatusOr<std::map<std::string, StoredRig>> GetRigs(
      const std::set<std::string>& names) override {
    return Read([&](Connection* db) { return ReadRigs(db, names); });
  }

  absl::StatusOr<std::vector<std::string>> ListRigsToCheck(
      RigCheck check, std::int64_t until_ns, int limit) override {
    return Read([&](Connection* db) {
      return RigsToCheck(db, check, until_ns, limit);
    });
  }

  using Store::ListRigs;
  absl::StatusOr<Listed<StoredRig>> ListRigs(const RigQuery& query,
                                             const Page& page) override {
    return Read([&](Connection* db) { return ListRigRows(db, query, page); });
  }

  absl::StatusOr<std::map<std::string, std::int64_t>> GetRigKeys(
      const std::set<std::string>& names) override {
    return Read([&](Connection* db) { return ReadRigKeys(db, names); });
  }

  absl::StatusOr<Listed<RigSummary>> ListRigSummaries(
      const RigQuery& query, const Page& page) override {
    return Read(
        [&](Connection* db) { return ListSummaryRows(db, query, page); });
  }

  absl::Status RaiseSilent(std::int64_t before_ns,
                           std::int64_t alarms) override {
    return db_->Write([&](Connection* db) {
      return server::RaiseSilent(db, before_ns, alarms);
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
      const Page& page,
      const RigQuery& of) override {
    return Read([&](Connection* db) {
      return ListSegmentRows(db, rig, query, page, of);
    });
  }

  absl::StatusOr<MotionSegment> GetSegmentData(const std::string& rig,
                                               const SegmentKey& key) override {
    std::optional<Calibration> of_device;
    SELFCAL_ASSIGN_OR_RETURN(
        const Payload payload,
        Read([&](Connection* db) -> absl::StatusOr<Payload> {
          SELFCAL_ASSIGN_OR_RETURN(of_device, FactoryIfReported(db, rig));
          return ReadPayload(db, rig, key);
        }));
    const std::string what = SegmentText(rig, key);
    SELFCAL_ASSIGN_OR_RETURN(MotionSegment segment,
                             UnpackSegment(payload, what));
    if (segment.key != key) {
      return OfAnotherSegment("the data of " + what, rig, segment.key);
    }
    if (of_device) {
      SELFCAL_RETURN_IF_ERROR(CheckReported(segment, what, *of_device));
    }
    return segment;
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

  absl::StatusOr<std::vector<Exclusion>> ListExclusions(
      const std::string& rig, const SegmentKey& key) override {
    return Read(
        [&](Connection* db) { return ListExclusionRows(db, rig, key); });
  }

  absl::StatusOr<std::vector<Unscored>> ListUnscored(
      int of_each_rig, const std::string& replica) override {
    return ReadForService([&](Connection* db) {
      return ListUnscoredRows(db, of_each_rig, replica);
    });
  }

  absl::StatusOr<std::int64_t> CountUnscored(const std::string& rig) override {
    return Read([&](Connection* db) { return CountUnscoredRows(db, rig); });
  }

  absl::StatusOr<std::vector<Table>> GetTables(
      const std::string& rig) override {
    return Read([&](Connection* db) -> absl::StatusOr<std::vector<Table>> {
      SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_id, FindRigId(db, rig));
      return ReadTables(db, rig_id);
    });
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

  absl::StatusOr<bool> WasActive(const std::string& rig,
                                 std::int64_t version) override {
    return ReadOne(
        [&](Connection* db) { return server::WasActive(db, rig, version); });
  }

  absl::StatusOr<std::vector<StoredCalibration>> GetReports(
      const std::vector<VersionId>& versions) override {
    return Read([&](Connection* db) { return ReadReports(db, versions); });
  }

  using Store::ListCalibrations;
  absl::StatusOr<Listed<StoredCalibration>> ListCalibrations(
      const std::string& rig,
      const CalibrationQuery& query,
      const Page& page,
      const RigQuery& of,
      CalibrationParts parts) override {
    return Read([&](Connection* db) {
      return ListCalibrationRows(db, rig, query, page, of, parts);
    });
  }

  absl::StatusOr<std::vector<VersionId>> ListIncompleteVersions(
      int limit) override {
    return ReadForService(
        [&](Connection* db) { return IncompleteVersions(db, limit); });
  }

  absl::StatusOr<Listed<StoredEstimate>> ListEstimates(
      const EstimateQuery& query, const Page& page) override {
    return Read(
        [&](Connection* db) { return ListEstimateRows(db, query, page); });
  }

  absl::StatusOr<std::vector<VersionId>> ListWithoutEstimates(
      int limit) override {
    return ReadForService(
        [&](Connection* db) { return VersionsWithoutEstimates(db, limit); });
  }

  absl::StatusOr<StoredRun> GetRun(const std::string& rig,
                                   std::int64_t run) override {
    return Read([&](Connection* db) { return ReadRun(db, rig, run); });
  }

  using Store::ListRuns;
  absl::StatusOr<Listed<StoredRun>> ListRuns(const std::string& rig,
                                             const RunQuery& query,
                                             const Page& page,
                                             const RigQuery& of) override {
    return Read(
        [&](Connection* db) { return ListRunRows(db, rig, query, page, of); });
  }

  absl::StatusOr<std::vector<StoredRun>> ListUnfinishedRuns(
      const std::string& replica) override {
    return ReadForService(
        [&](Connection* db) { return ListUnfinishedRunRows(db, replica); });
  }

  absl::StatusOr<WorkCount> CountWork() override {
    return Read([&](Connection* db) { return CountWorkRows(db); });
  }

  absl::StatusOr<std::set<std::string>> FindBusyRigs(
      const std::set<std::string>& rigs) override {
    return ReadForService([&](Connection* db) { return BusyRigs(db, rigs); });
  }

  absl::StatusOr<StoredCalibration> GetCandidate(const std::string& rig,
                                                 std::int64_t run) override {
    return Read(
        [&](Connection* db) { return CandidateCalibration(db, rig, run); });
  }

  absl::StatusOr<Listed<StoredInstruction>> ListInstructions(
      const std::string& rig, const Page& page) override {
    return Read(
        [&](Connection* db) { return ListInstructionRows(db, rig, page); });
  }

  absl::StatusOr<Listed<StoredCohort>> ListCohorts(const std::string& label,
                                                   const std::string& value,
                                                   const Page& page) override {
    return Read(
        [&](Connection* db) { return ListCohortRows(db, label, value, page); });
  }

  absl::StatusOr<std::vector<std::string>> ListLabelValues(
      const std::string& label) override {
    return Read([&](Connection* db) { return LabelValues(db, label); });
  }

  absl::StatusOr<std::map<std::string, std::int64_t>> ListOutliers() override {
    return Read([&](Connection* db) { return Outliers(db); });
  }

  absl::StatusOr<std::int64_t> PutCohort(const StoredCohort& cohort,
                                         std::int64_t kept) override {
    absl::StatusOr<std::int64_t> version;
    SELFCAL_RETURN_IF_ERROR(WriteInTransaction(db_.get(), [&](Connection* db) {
      version = InsertCohort(db, cohort, kept);
      return version.status();
    }));
    return version;
  }

  absl::StatusOr<Listed<StoredEvent>> ListEvents(const Page& page,
                                                 const std::string& rig,
                                                 const RigQuery& of) override {
    return Read(
        [&](Connection* db) { return ListEventRows(db, page, rig, of); });
  }

  absl::StatusOr<Listed<StoredEvent>> ListNewestEvents(
      const Page& page, const std::string& rig, const RigQuery& of) override {
    return Read(
        [&](Connection* db) { return ListNewestEventRows(db, page, rig, of); });
  }

  absl::Status AppendEvent(const StoredEvent& event) override {
    return db_->Write(
        [&](Connection* db) { return InsertEvent(db, event).status(); });
  }

  absl::Status EndReports(std::int64_t key,
                          std::int64_t attempt,
                          std::int64_t now_ns,
                          std::int64_t kept_ns) override {
    return WriteInTransaction(db_.get(), [&](Connection* db) {
      return WriteEndOfReports(db, key, attempt, now_ns, kept_ns);
    });
  }

  absl::StatusOr<ReportedCount> CountReported(
      std::int64_t silent_before_ns) override {
    return Read([&](Connection* db) {
      return CountReportedRows(db, silent_before_ns);
    });
  }

  absl::StatusOr<std::optional<ClockRecord>> ReadClock() override {
    return Read([&](Connection* db) { return ReadClockRecord(db); });
  }

  absl::Status WriteClock(const ClockRecord& clock,
                          const std::optional<StoredEvent>& event) override {
    return WriteInTransaction(db_.get(), [&](Connection* db) -> absl::Status {
      SELFCAL_RETURN_IF_ERROR(WriteClockRecord(db, clock));
      return event ? InsertEvent(db, *event).status() : absl::OkStatus();
    });
  }

  std::shared_ptr<void> Listen(OnAnnouncement heard) override {
    return db_->Listen([heard = std::move(heard)](const auto& text) {
      const auto announcement = ParseAnnouncement(text);
      if (announcement) heard(*announcement);
    });
  }

  Replicas* replicas() override { return replicas_.get(); }

  Outbox* outbox() override { return outbox_.get(); }

  StoreMaintenance* maintenance() override { return maintenance_.get(); }

 private:
  // `query` returns a Status or a StatusOr.
  template <typename Query>
  std::invoke_result_t<Query, Connection*> Read(const Query& query) {
    return ReadWith(&Database::Read, query);
  }
  template <typename Query>
  std::invoke_result_t<Query, Connection*> ReadOne(const Query& query) {
    return ReadWith(&Database::ReadOne, query);
  }
  template <typename Query>
  std::invoke_result_t<Query, Connection*> ReadForService(const Query& query) {
    return ReadWith(&Database::ReadForService, query);
  }
  template <typename Query>
  std::invoke_result_t<Query, Connection*> ReadWith(
      absl::Status (Database::*read)(const Database::Work&),
      const Query& query) {
    std::invoke_result_t<Query, Connection*> result = absl::UnknownError("");
    const absl::Status status = ((*db_).*read)([&](Connection* db) {
      result = query(db);
      return StatusOf(result);
    });
    SELFCAL_RETURN_IF_ERROR(status);
    return result;
  }

  static absl::Status CarryOut(Connection* db,
                               const RigClaim& claim,
                               const Moment& now,
                               const Work& work) {
    Transaction transaction(db);
    SELFCAL_RETURN_IF_ERROR(transaction.status());
    SELFCAL_ASSIGN_OR_RETURN(const std::int64_t row, LockRig(db, claim.rig));
    SELFCAL_RETURN_IF_ERROR(CheckClaim(db, row, claim));
    UnitOfWork tx(db, claim.rig, row, now);
    SELFCAL_RETURN_IF_ERROR(work(&tx));
    SELFCAL_RETURN_IF_ERROR(NoteChanges(&tx));
    return transaction.Commit();
  }

  static absl::Status StatusOf(const absl::Status& status) { return status; }
  template <typename T>
  static absl::Status StatusOf(const absl::StatusOr<T>& result) {
    return result.status();
  }

  const std::unique_ptr<Database> db_;
  const std::unique_ptr<Replicas> replicas_;
  const std::unique_ptr<Outbox> outbox_;
  const std::unique_ptr<StoreMaintenance> maintenance_;
};

}  // namespace

std::unique_ptr<Store> MakeStore(std::unique_ptr<Database> database) {
  return std::make_unique<DatabaseStore>(std::move(database));
}

}  // namespace selfcal::server
