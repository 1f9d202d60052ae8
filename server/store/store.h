// Records of everything that selfcald keeps, and transactions on them. The
// store has no policy: server/domain decides what is written. It keeps them in
// the database of an engine behind a driver (make_store.h, driver/driver.h);
// every engine must pass the same tests.
//
// A transaction happens as a whole or not at all: when Transact returns OK it
// is committed and synced, when it returns an error nothing has changed.
// Concurrent transactions may share one commit and its sync. Any thread may
// call; writes to one rig exclude each other. SQLite carries out all writes one
// after the other, PostgreSQL those of different rigs at the same time. Errors
// caused by the caller: NOT_FOUND, ALREADY_EXISTS, FAILED_PRECONDITION, and
// INVALID_ARGUMENT for a page token. Errors of the environment:
// RESOURCE_EXHAUSTED (disk full), DATA_LOSS (a checksum does not match),
// UNAVAILABLE.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/change/aged.h"
#include "core/change/detect_change.h"
#include "core/information/segment_ends.h"
#include "core/information/segment_information.h"
#include "core/model/motion_statistics.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/selection/tables.h"
#include "server/store/calibration_query.h"
#include "server/store/clock_record.h"
#include "server/store/estimate_query.h"
#include "server/store/moment.h"
#include "server/store/rig_checks.h"
#include "server/store/rig_claim.h"
#include "server/store/rig_query.h"
#include "server/store/run_query.h"
#include "server/store/segment_query.h"
#include "server/store/session.h"
#include "server/store/stored_event.h"

namespace selfcal::server {

// Selects a page of a list.
struct Page {
  int size = 50;
  std::string token;  // opaque, from the page before; empty for the first
};
template <typename T>
struct Listed {
  std::vector<T> items;
  std::string next_token;  // empty on the last page
};

// Time-based policy of a rig; 0 disables a rule.
struct RigPolicy {
  // Segments that arrived longer ago leave the tables.
  std::int64_t table_max_age_ns = 0;
  // From the end of a run to the beginning of the next one that is not manual.
  std::int64_t recalibration_min_interval_ns = 0;
  // A calibration that has been active for longer is recalibrated.
  std::int64_t calibration_max_age_ns = 0;
  // Random walk of the components (core/change/aged.h).
  std::vector<WalkDensity> walk_densities;

  friend bool operator==(const RigPolicy&, const RigPolicy&) = default;
};

struct StoredRig {
  Rig rig;
  std::int64_t create_time_ns = 0;  // since the Unix epoch
  RigPolicy policy = {};
  std::map<std::string, std::string> labels = {};
};

struct StoredSegment {
  std::string rig;
  SegmentKey key;
  std::int64_t sequence = 0;  // order of arrival in the rig, from 1
  SegmentState state = SegmentState::kStored;
  bool has_data = false;
  std::int64_t payload_bytes = 0;  // compressed, 0 once dropped
  std::int64_t receive_time_ns = 0;
  std::int64_t calibration_version = 1;
  std::int64_t start_ns = 0;
  std::int64_t end_ns = 0;
  int keyframes = 0;
  int imu_samples = 0;
  int landmarks = 0;
  int observations = 0;
  std::optional<double> temperature_c;  // of the device
  // nullopt: an earlier program, which did not compute it, received the
  // segment.
  std::optional<MotionStatistics> motion;
  std::optional<SegmentInformation> information;  // if scored
  std::vector<std::string> tables;                // groups that hold it
  // Why it is unusable or its data is gone. Empty if neither holds, or if the
  // data was deleted because no table and no run needs it.
  std::string problem;
};

// A check that could not be made is never treated as passed.
enum class CheckOutcome { kPassed, kFailed, kNotTested };

struct ValidationCheck {
  std::string name;
  double value = 0;
  double limit = 0;
  CheckOutcome outcome = CheckOutcome::kNotTested;
  // The value, what it means and what to do. Empty for a check that passed,
  // unless there is something to note.
  std::string sentence = {};
};

// How well a candidate, and the active version, predict the information of
// segments that the candidate was not calibrated on.
struct HeldOutTest {
  int segments = 0;  // that were tested
  int left_out = 0;  // not testable, or the one that fits worst
  ConsistencyTest candidate;
  ConsistencyTest active;
  int rescored = 0;  // of `segments`: scored again at the candidate
};

// The checks of a candidate.
struct StoredValidation {
  std::int64_t active_version = 0;  // it was validated against this
  std::vector<ValidationCheck> checks;
  HeldOutTest held_out;
};

// The verdict on a version, computed once, when it was validated
// (server/pipeline/verdict.h). Every interface shows this one.
struct Verdict {
  VerdictKind kind = VerdictKind::kUnknown;
  std::vector<std::string> sentences;  // the reasons
};

// Temperatures of the device in those segments of a calibration that state one.
struct SegmentTemperatures {
  int segments = 0;
  double mean_c = 0;
  double min_c = 0;
  double max_c = 0;
};

// The name of a rig, and the number of a version of it.
using VersionId = std::pair<std::string, std::int64_t>;

struct StoredCalibration {
  std::string rig;
  std::int64_t version = 0;  // 1 is the factory calibration
  CalibrationState state = CalibrationState::kActive;
  std::int64_t create_time_ns = 0;
  std::int64_t create_steady_ns = 0;  // the same by steady time (Moment)
  Calibration theta;
  Eigen::MatrixXd covariance;        // D x D
  std::vector<std::string> reasons;  // why it was rejected
  std::optional<std::int64_t> run;   // that produced it
  std::int64_t base_version = 0;     // start of the solver; 0: none
  std::vector<SegmentKey> segments;
  // Derived from the segments when read, never written.
  std::optional<SegmentTemperatures> temperatures;
  std::string program_version;
  int schema_version = 0;  // of the database; 0 if it was not recorded
  // Names and values of the settings that shape the result.
  std::vector<std::pair<std::string, std::string>> settings;
  std::optional<CalibrationResult> report;     // of the solver
  std::vector<CalibrateProgress> steps;        // iterations of the solver
  std::optional<StoredValidation> validation;  // if it was validated
  Verdict verdict;                             // likewise
  double seconds = 0;                          // to compute it
  // A finding after its validation, for which it must not be trusted: the two
  // cores disagree on what it rests on, or later segments show an effect that
  // shifts it. Empty: none.
  std::string finding;
  // The newest change of the device that its run does not account for; 0: none.
  std::int64_t changed_since = 0;
  // Number of its newest activation, counted from 1 in its rig; 0 if it never
  // was active.
  std::int64_t activation = 0;
  // Of the rig in the database. A rig that was deleted and created again has
  // another one.
  std::int64_t rig_key = 0;
};

// A parameter of a version.
struct StoredEstimate {
  std::string rig;
  std::int64_t version = 0;
  std::int64_t create_time_ns = 0;  // of the version
  CalibrationState state = CalibrationState::kActive;
  std::string component;
  std::string unit;
  double value = 0;
  std::optional<double> sigma;         // nullopt: not a number
  std::optional<double> from_factory;  // nullopt: of other cameras
};

struct StoredRun {
  std::string rig;
  std::int64_t run = 0;  // counts from 1 in a rig
  RunState state = RunState::kPending;
  RunTrigger trigger = RunTrigger::kManual;
  std::int64_t create_time_ns = 0;
  std::int64_t end_time_ns = 0;  // 0 until it has ended
  // The same by steady time (Moment).
  std::int64_t create_steady_ns = 0;
  std::int64_t end_steady_ns = 0;
  std::int64_t base_version = 0;     // active when it was created
  std::int64_t change = 0;           // the newest when it was created; 0: none
  std::vector<SegmentKey> segments;  // the snapshot of the tables
  int attempts = 0;
  std::int64_t calibration_version = 0;  // 0 until it succeeded
  // Why it failed or was cancelled; while it is pending, why it is deferred.
  std::string message;
};

// A device change.
struct StoredChange {
  std::string rig;
  std::int64_t change = 0;   // counts from 1 in a rig
  std::int64_t time_ns = 0;  // when it was detected
  ChangeKind kind = ChangeKind::kSudden;
  // Segments with a smaller sequence lie before it.
  std::int64_t first_sequence = 0;
  // The version whose knowledge of groups that are not concerned remains valid:
  // the one that was active, or an earlier one without segments from after the
  // change; 1: there is none, and nothing is known.
  std::int64_t base_version = 0;
  std::vector<std::string> groups;  // concerned
  double inflation = 1;             // factor on the variances of segments
};

// The numbers are those on disk and never change.
enum class InstructionState { kPending = 1, kDone = 2, kRefused = 3 };

// What a hub has the device of a rig do.
struct StoredInstruction {
  std::string rig;
  std::int64_t instruction = 0;  // counts from 1 in a rig
  std::int64_t create_time_ns = 0;
  std::string caller;   // who gave it
  std::string request;  // selfcal.v1.Instruction with its request, serialised
  InstructionState state = InstructionState::kPending;
  std::string message;           // why the device refused it
  std::int64_t end_time_ns = 0;  // 0 while it is pending
};

// The statistics of a cohort, the rigs with this label, as they were once.
struct StoredCohort {
  std::string label;
  std::string value;
  std::int64_t version = 0;  // counts from 1 in a cohort
  std::int64_t time_ns = 0;  // since the Unix epoch
  std::string content;       // selfcal.v1.Cohort, serialised
};

// The state of the reports of a device to its hub, about one rig.
struct ReportState {
  std::int64_t time_ns = 0;     // of the last that was taken; 0: none
  std::int64_t waiting = 0;     // records that are still to be reported
  std::string program_version;  // of the device; empty on the device itself
};

// Summary of a rig, for lists.
struct RigSummary {
  std::string rig;
  std::int64_t create_time_ns = 0;
  std::map<std::string, std::string> labels;
  std::int64_t last_seen_ns = 0;  // when its newest segment arrived; 0: none
  std::int64_t active_version = 0;
  std::int64_t active_since_ns = 0;
  std::vector<Table> tables;  // in the order of the rig's groups
  std::int64_t newest_version = 0;
  CalibrationState newest_state = CalibrationState::kActive;
  std::int64_t newest_run = 0;  // 0: none, as for the change
  RunState run_state = RunState::kPending;
  std::int64_t newest_change_ns = 0;  // device change
  std::int64_t changed_since = 0;     // of the active version
  std::int64_t unlike_cohort = 0;     // version that contradicts the cohort
  std::optional<ReportState> uplink;  // on a device that has a hub
  std::optional<ReportState> device;  // at the hub, if a device reports it
};

struct Announcement;     // announcements.h
class Outbox;            // outbox.h
class Replicas;          // replicas.h
class StoreMaintenance;  // maintenance.h
class UnitOfWork;        // unit_of_work.h

class Store {
 public:
  virtual ~Store() = default;

  // --- Transactions. `work` uses the record functions of this module on its
  // unit of work. It must be short, and may run again if the commit that
  // included it failed for another reason.
  using Work = std::function<absl::Status(UnitOfWork*)>;
  using Done = std::function<void(const absl::Status&)>;

  // Commits what `work` writes, unless it returns an error. `now` is the time
  // of all that it writes. NOT_FOUND if there is no such rig, ClaimLost if the
  // claim does not hold.
  virtual absl::Status Transact(const RigClaim& claim,
                                const Moment& now,
                                const Work& work) = 0;
  // Transact without waiting. Transactions of one thread are carried out in the
  // order in which they begin. `done` is called once, on a thread of the store;
  // it must be short, and must neither call the store nor take a lock that
  // somebody holds while waiting for a transaction.
  virtual void BeginTransaction(const std::string& rig,
                                const Moment& now,
                                Work work,
                                Done done) = 0;
  // Transact for a rig that is inserted first. ALREADY_EXISTS.
  virtual absl::Status InsertRig(const StoredRig& rig,
                                 const Moment& now,
                                 const Work& work) = 0;
  // Runs `work`, which only reads, on one state of the database.
  virtual absl::Status Inspect(const std::string& rig, const Work& work) = 0;

  // --- Rigs.
  virtual absl::StatusOr<StoredRig> GetRig(const std::string& rig) = 0;
  // Those that exist, by name.
  virtual absl::StatusOr<std::map<std::string, StoredRig>> GetRigs(
      const std::set<std::string>& names) = 0;
  // The same, their keys in the database: a rig that was deleted and created
  // again has another one.
  virtual absl::StatusOr<std::map<std::string, std::int64_t>> GetRigKeys(
      const std::set<std::string>& names) = 0;
  // Both read no more than the page, however many rigs there are, unless the
  // query has conditions.
  virtual absl::StatusOr<Listed<StoredRig>> ListRigs(const RigQuery& query,
                                                     const Page& page) = 0;
  absl::StatusOr<Listed<StoredRig>> ListRigs(const Page& page) {
    return ListRigs({}, page);
  }
  virtual absl::StatusOr<Listed<RigSummary>> ListRigSummaries(
      const RigQuery& query, const Page& page) = 0;
  // Names of at most `limit` rigs whose check is due at this steady time
  // (Moment), the one that is due first at the front.
  virtual absl::StatusOr<std::vector<std::string>> ListRigsToCheck(
      RigCheck check, std::int64_t until_ns, int limit) = 0;

  // RaiseSilent of rigs.h.
  virtual absl::Status RaiseSilent(std::int64_t before_ns,
                                   std::int64_t alarms) = 0;

  // --- Segments.
  virtual absl::StatusOr<StoredSegment> GetSegment(const std::string& rig,
                                                   const SegmentKey& key) = 0;
  // The segments of one rig or, if `rig` is empty, of those of `of`; then in an
  // order by arrival (steady time) or gain. INVALID_ARGUMENT for another order.
  virtual absl::StatusOr<Listed<StoredSegment>> ListSegments(
      const std::string& rig,
      const SegmentQuery& query,
      const Page& page,
      const RigQuery& of = {}) = 0;
  // All segments, newest first.
  absl::StatusOr<Listed<StoredSegment>> ListSegments(const std::string& rig,
                                                     const Page& page) {
    return ListSegments(rig, {}, page);
  }
  // FAILED_PRECONDITION if its data was dropped; DATA_LOSS if it is damaged.
  virtual absl::StatusOr<MotionSegment> GetSegmentData(
      const std::string& rig, const SegmentKey& key) = 0;
  // Sessions of a rig by name.
  virtual absl::StatusOr<Listed<SessionSummary>> ListSessions(
      const std::string& rig, const Page& page) = 0;
  // Segments of one session by index. NOT_FOUND if there is no record of it.
  virtual absl::StatusOr<Listed<SessionSegment>> ListSessionSegments(
      const std::string& rig, const std::string& session, const Page& page) = 0;
  virtual absl::StatusOr<SessionSummary> GetSession(
      const std::string& rig, const std::string& session) = 0;
  // Exclusions of the segment, as far as they were recorded.
  virtual absl::StatusOr<std::vector<Exclusion>> ListExclusions(
      const std::string& rig, const SegmentKey& key) = 0;
  // The `of_each_rig` oldest unscored segments of the rigs that no device
  // reports, or of those of them that a replica has claimed. Those of one rig
  // follow each other, in the order of their arrival. Reads no others, however
  // many there are.
  struct Unscored {
    std::string rig;
    SegmentKey key;
    std::int64_t sequence;
    std::int64_t readings = 0;  // observations and samples of the IMU
  };
  virtual absl::StatusOr<std::vector<Unscored>> ListUnscored(
      int of_each_rig, const std::string& replica = "") = 0;
  // Number of unscored segments of the rig.
  virtual absl::StatusOr<std::int64_t> CountUnscored(
      const std::string& rig) = 0;
  virtual absl::StatusOr<std::vector<Table>> GetTables(
      const std::string& rig) = 0;

  virtual absl::StatusOr<StoredChange> GetChange(const std::string& rig,
                                                 std::int64_t change) = 0;

  // --- Calibrations.
  virtual absl::StatusOr<StoredCalibration> GetCalibration(
      const std::string& rig, std::int64_t version) = 0;
  virtual absl::StatusOr<StoredCalibration> GetActiveCalibration(
      const std::string& rig) = 0;
  // True if the version has ever been the active one. Reads nothing of its
  // content. NOT_FOUND.
  virtual absl::StatusOr<bool> WasActive(const std::string& rig,
                                         std::int64_t version) = 0;
  // Rig, version, report and seconds of those that exist and are not damaged,
  // in any order.
  virtual absl::StatusOr<std::vector<StoredCalibration>> GetReports(
      const std::vector<VersionId>& versions) = 0;
  // The versions of one rig or, if `rig` is empty, of those of `of` without
  // damaged ones: newest first unless the query says otherwise, by the steady
  // time of all rigs for a query without conditions. They lack `steps`.
  virtual absl::StatusOr<Listed<StoredCalibration>> ListCalibrations(
      const std::string& rig,
      const CalibrationQuery& query,
      const Page& page,
      const RigQuery& of = {},
      CalibrationParts parts = CalibrationParts::kAll) = 0;
  absl::StatusOr<Listed<StoredCalibration>> ListCalibrations(
      const std::string& rig, const Page& page, const RigQuery& of = {}) {
    return ListCalibrations(rig, {}, page, of);
  }
  // Versions whose verdict or temperature no list finds, as an earlier program
  // has written them.
  virtual absl::StatusOr<std::vector<VersionId>> ListIncompleteVersions(
      int limit) = 0;
  // Parameters of versions, of all rigs of the query, in the order of keys of
  // rigs, versions and components. NOT_FOUND for the name of no rig.
  virtual absl::StatusOr<Listed<StoredEstimate>> ListEstimates(
      const EstimateQuery& query, const Page& page) = 0;
  // Versions that have no such records: from before they were written, or
  // without values that are numbers.
  virtual absl::StatusOr<std::vector<VersionId>> ListWithoutEstimates(
      int limit) = 0;
  // The candidate that a run has stored; NOT_FOUND if it has none.
  virtual absl::StatusOr<StoredCalibration> GetCandidate(const std::string& rig,
                                                         std::int64_t run) = 0;

  // --- Runs.
  virtual absl::StatusOr<StoredRun> GetRun(const std::string& rig,
                                           std::int64_t run) = 0;
  // The runs of one rig or, if `rig` is empty, of those of `of`, in the order
  // of ListCalibrations.
  virtual absl::StatusOr<Listed<StoredRun>> ListRuns(
      const std::string& rig,
      const RunQuery& query,
      const Page& page,
      const RigQuery& of = {}) = 0;
  absl::StatusOr<Listed<StoredRun>> ListRuns(const std::string& rig,
                                             const Page& page,
                                             const RigQuery& of = {}) {
    return ListRuns(rig, {}, page, of);
  }
  // Pending and running runs of the rigs that no device reports, or of those
  // that a replica has claimed, oldest first. After a restart, a running one
  // starts again.
  virtual absl::StatusOr<std::vector<StoredRun>> ListUnfinishedRuns(
      const std::string& replica = "") = 0;
  // How many of both there are, and those of these rigs that have some.
  struct WorkCount {
    std::int64_t segments = 0;
    std::int64_t runs = 0;
  };
  virtual absl::StatusOr<WorkCount> CountWork() = 0;
  virtual absl::StatusOr<std::set<std::string>> FindBusyRigs(
      const std::set<std::string>& rigs) = 0;

  // --- Instructions for the device of a rig, newest first.
  virtual absl::StatusOr<Listed<StoredInstruction>> ListInstructions(
      const std::string& rig, const Page& page) = 0;

  // --- Cohorts. Their statistics belong to no single rig.
  // Every version of a cohort, newest first, or the newest of each if the label
  // is empty.
  virtual absl::StatusOr<Listed<StoredCohort>> ListCohorts(
      const std::string& label, const std::string& value, const Page& page) = 0;
  // The values that rigs have of a label, in their order.
  virtual absl::StatusOr<std::vector<std::string>> ListLabelValues(
      const std::string& label) = 0;
  // The rigs of which a version contradicted its cohort, with that version.
  virtual absl::StatusOr<std::map<std::string, std::int64_t>>
  ListOutliers() = 0;
  // Stores the next version of a cohort, whatever the record states, and
  // deletes all but the newest `kept`. Returns its number; 0 if another daemon
  // stored it at the same time.
  virtual absl::StatusOr<std::int64_t> PutCohort(const StoredCohort& cohort,
                                                 std::int64_t kept) = 0;

  // --- Events, oldest or newest first, of one rig or, if `rig` is empty, of
  // those of `of`: of every rig, also those of the daemon and of deleted rigs.
  // Those of one rig contain the events of earlier rigs of its name, unless
  // `of` has a choice of rigs. They are only ever appended.
  //
  // Those of one rig are in the order of their numbers, in which they were
  // committed: whoever reads on after the last one misses none. Those of all
  // rigs are in the order of their steady time: pages show each event that was
  // there when the first one was read, and later ones may come before what was
  // read, by the duration of a transaction or by what the clocks of several
  // daemons differ.
  virtual absl::StatusOr<Listed<StoredEvent>> ListEvents(
      const Page& page,
      const std::string& rig = "",
      const RigQuery& of = {}) = 0;
  virtual absl::StatusOr<Listed<StoredEvent>> ListNewestEvents(
      const Page& page,
      const std::string& rig = "",
      const RigQuery& of = {}) = 0;
  // Appends an event of the daemon (without a rig); its number is assigned.
  virtual absl::Status AppendEvent(const StoredEvent& event) = 0;

  // --- Reports of devices (report.h).
  // The device has deleted the rig with this key in its database, as reported
  // in this attempt; the first report of the rig by an older attempt that
  // arrives later is ignored (ReadEndOfReports). Waits for those that are being
  // taken. Forgets deletions that are older than `kept_ns`.
  virtual absl::Status EndReports(std::int64_t key,
                                  std::int64_t attempt,
                                  std::int64_t now_ns,
                                  std::int64_t kept_ns) = 0;
  // The rigs that devices report, by the last report of each.
  struct ReportedCount {
    std::int64_t rigs = 0;
    std::int64_t silent = 0;     // without a report since the time asked for
    std::int64_t waiting = 0;    // records that were still to be reported then
    std::int64_t oldest_ns = 0;  // time of the oldest last report; 0: none
    std::int64_t newest_ns = 0;
  };
  // Reads one row of each of them.
  virtual absl::StatusOr<ReportedCount> CountReported(
      std::int64_t silent_before_ns) = 0;

  // --- The clock of the device, of which there is one record.
  // nullopt before the first is written.
  virtual absl::StatusOr<std::optional<ClockRecord>> ReadClock() = 0;
  // Replaces the record and, if there is an event, appends it.
  virtual absl::Status WriteClock(const ClockRecord& clock,
                                  const std::optional<StoredEvent>& event) = 0;

  // Passes on what other daemons announce, until the result is released; null
  // if no other one can share the database. `heard` is called on a thread of
  // the store, which it may hold up and from which it may read.
  using OnAnnouncement = std::function<void(const Announcement&)>;
  virtual std::shared_ptr<void> Listen(OnAnnouncement heard) = 0;
  // The daemons that share the database. Lives as long as the store.
  virtual Replicas* replicas() = 0;
  // What a device has still to report to its hub. Lives as long as the store.
  virtual Outbox* outbox() = 0;
  // Check, backup and restore. Lives as long as the store.
  virtual StoreMaintenance* maintenance() = 0;
};

}  // namespace selfcal::server
