// Records of everything that selfcald keeps, and transactions on them. It holds
// no policy: server/domain decides what is written. The SQLite store
// (store_sqlite.h) is the implementation; another engine proves itself by the
// same tests.
//
// A transaction happens as a whole or not at all: when Transact returns OK it
// is committed and synced, when it returns an error nothing has changed.
// Transactions that come at the same time may share one commit and its sync.
// Any thread may call; writes are serialised inside.
// Errors: NOT_FOUND, ALREADY_EXISTS, FAILED_PRECONDITION from the caller's
// side; RESOURCE_EXHAUSTED (disk full), DATA_LOSS (a checksum does not match),
// UNAVAILABLE from the environment.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/change/aged.h"
#include "core/change/detect_change.h"
#include "core/information/segment_ends.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/selection/tables.h"
#include "server/store/rig_query.h"
#include "server/store/segment_query.h"
#include "server/store/session.h"
#include "server/store/stored_event.h"

namespace selfcal::server {

// A page of a list: everything after the token of the page before.
struct Page {
  int size = 50;
  std::string token;  // opaque; empty for the first page
};
template <typename T>
struct Listed {
  std::vector<T> items;
  std::string next_token;  // empty on the last page
};

// What of a rig goes by the clock; 0: no matter.
struct RigPolicy {
  // Segments that arrived longer ago leave the tables.
  std::int64_t table_max_age_ns = 0;
  // From the end of a run to the beginning of the next that the tables or the
  // age of the calibration call for.
  std::int64_t recalibration_min_interval_ns = 0;
  // A calibration that has been active for longer is computed anew.
  std::int64_t calibration_max_age_ns = 0;
  // How fast components change by themselves (core/change/aged.h).
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
  std::optional<double> temperature_c;            // of the device
  std::optional<SegmentInformation> information;  // once scored
  std::vector<std::string> tables;                // groups that hold it
  // Why it is unusable, or its data gone; empty: neither, or no table and no
  // run needs the data.
  std::string problem;
};

// What may become what: calibration_states.h.
enum class CalibrationState {
  kActive,
  kSuperseded,
  kRejected,
  kCandidate,
  kRolledBack,
};

// A check that could not be made never counts as passed.
enum class CheckOutcome { kPassed, kFailed, kNotTested };

struct ValidationCheck {
  std::string name;
  double value = 0;
  double limit = 0;
  CheckOutcome outcome = CheckOutcome::kNotTested;
  // The value, what it means and what to do. Of one that passed only where
  // there is something to note.
  std::string sentence = {};
};

// Of segments that a candidate was not calibrated on: how well it predicts what
// they show, and how well the active version does.
struct HeldOutTest {
  int segments = 0;  // that were tested
  int left_out = 0;  // that could not be tested, or fit worst
  ConsistencyTest candidate;
  ConsistencyTest active;
  int rescored = 0;  // of `segments`: scored again at the candidate
};

// The checks of a candidate.
struct StoredValidation {
  std::int64_t active_version = 0;  // that it was validated against
  std::vector<ValidationCheck> checks;
  HeldOutTest held_out;
};

enum class VerdictKind {
  kUnknown,  // not validated yet, or from before there were verdicts
  kGood,
  kWeak,
  kNotTrustworthy,
  kFactory,
};

// What a version is good for, computed once, when it was validated
// (server/pipeline/verdict.h). Every interface shows this one.
struct Verdict {
  VerdictKind kind = VerdictKind::kUnknown;
  std::vector<std::string> sentences;  // what it rests on
};

// Of the device in the segments of a calibration that say so.
struct SegmentTemperatures {
  int segments = 0;
  double mean_c = 0;
  double min_c = 0;
  double max_c = 0;
};

struct StoredCalibration {
  std::string rig;
  std::int64_t version = 0;  // the factory's is 1
  CalibrationState state = CalibrationState::kActive;
  std::int64_t create_time_ns = 0;
  Calibration theta;
  Eigen::MatrixXd covariance;        // D x D
  std::vector<std::string> reasons;  // why it was rejected
  std::optional<std::int64_t> run;   // that produced it
  std::int64_t base_version = 0;     // where the solver started, 0: none
  std::vector<SegmentKey> segments;
  // Read with it, never written: the segments have it.
  std::optional<SegmentTemperatures> temperatures;
  std::string program_version;
  int schema_version = 0;  // of the database; 0 from before it was kept
  // Name and value of what shaped the run's result.
  std::vector<std::pair<std::string, std::string>> settings;
  std::optional<CalibrationResult> report;     // of the solver
  std::vector<CalibrateProgress> steps;        // the iterations of the solver
  std::optional<StoredValidation> validation;  // of one that was a candidate
  Verdict verdict;                             // the same
  double seconds = 0;                          // it took
  // What a verification found, by which the two cores disagree on what this
  // version stands on: it is not to be trusted. Empty: nothing.
  std::string disagreement;
  // Counts the activations of all rigs: that of its newest, 0 if it never was
  // active.
  std::int64_t activation = 0;
};

enum class RunState { kPending, kRunning, kSucceeded, kFailed, kCancelled };
enum class RunTrigger {
  kTablesFull,
  kTablesChanged,
  kManual,
  kChangeDetected,  // the tables are full again, for the first time since one
  kCalibrationAged,
  kSessionEnded,  // and the tables have changed since the last run
};

struct StoredRun {
  std::string rig;
  std::int64_t run = 0;  // counts from 1 in a rig
  RunState state = RunState::kPending;
  RunTrigger trigger = RunTrigger::kManual;
  std::int64_t create_time_ns = 0;
  std::int64_t end_time_ns = 0;      // 0 until it has ended
  std::int64_t base_version = 0;     // active when it was created
  std::int64_t change = 0;           // the newest when it was created, 0: none
  std::vector<SegmentKey> segments;  // the snapshot of the tables
  int attempts = 0;
  std::int64_t calibration_version = 0;  // 0 until it succeeded
  // Why it failed; while it is pending, why it is held back.
  std::string message;
};

// The device has changed.
struct StoredChange {
  std::string rig;
  std::int64_t change = 0;   // counts from 1 in a rig
  std::int64_t time_ns = 0;  // when it was detected
  ChangeKind kind = ChangeKind::kSudden;
  // Segments of a smaller sequence lie before it.
  std::int64_t first_sequence = 0;
  // The calibration that was active: what it knows of other groups than these
  // stays known.
  std::int64_t base_version = 0;
  std::vector<std::string> groups;  // concerned
  double inflation = 1;             // of the variances of segments in the test
};

// A rig in a list of many.
struct RigSummary {
  std::string rig;
  std::int64_t create_time_ns = 0;
  std::map<std::string, std::string> labels;
  std::int64_t last_seen_ns = 0;  // its newest segment arrived; 0: none so far
  std::int64_t active_version = 0;
  std::int64_t active_since_ns = 0;
  std::vector<Table> tables;  // in the order of the rig's groups
  std::int64_t newest_version = 0;
  CalibrationState newest_state = CalibrationState::kActive;
  std::int64_t newest_run = 0;  // 0: none so far, as the change
  RunState run_state = RunState::kPending;
  std::int64_t newest_change_ns = 0;  // of the device
};

class StoreMaintenance;  // maintenance.h
class UnitOfWork;        // unit_of_work.h

class Store {
 public:
  virtual ~Store() = default;

  // --- Transactions. `work` uses the record functions of this module on its
  // unit of work; it must be short, and may run again if the commit that it was
  // part of failed for another reason.
  using Work = std::function<absl::Status(UnitOfWork*)>;
  using Done = std::function<void(const absl::Status&)>;

  // Commits what `work` writes, unless it returns an error. `time_ns` is
  // stamped on what is written. NOT_FOUND for the rig.
  virtual absl::Status Transact(const std::string& rig,
                                std::int64_t time_ns,
                                const Work& work) = 0;
  // The same without waiting. What one thread begins is carried out in that
  // order. `done` is called once, on a thread of the store; it must be short
  // and must not call the store.
  virtual void BeginTransaction(const std::string& rig,
                                std::int64_t time_ns,
                                Work work,
                                Done done) = 0;
  // The same for a rig that is inserted first; stamped with its creation time.
  // ALREADY_EXISTS.
  virtual absl::Status InsertRig(const StoredRig& rig, const Work& work) = 0;
  // `work` only reads, one state of the database.
  virtual absl::Status Inspect(const std::string& rig, const Work& work) = 0;

  // --- Rigs.
  virtual absl::StatusOr<StoredRig> GetRig(const std::string& rig) = 0;
  // Both read no more than the page, however many rigs there are, unless the
  // query has conditions.
  virtual absl::StatusOr<Listed<StoredRig>> ListRigs(const RigQuery& query,
                                                     const Page& page) = 0;
  absl::StatusOr<Listed<StoredRig>> ListRigs(const Page& page) {
    return ListRigs({}, page);
  }
  virtual absl::StatusOr<Listed<RigSummary>> ListRigSummaries(
      const RigQuery& query, const Page& page) = 0;
  virtual absl::StatusOr<std::vector<std::string>> ListRigNames() = 0;
  // Names of rigs whose newest segment arrived, but not after this time.
  virtual absl::StatusOr<std::vector<std::string>> ListIdleRigs(
      std::int64_t idle_since_ns) = 0;

  // --- Segments.
  virtual absl::StatusOr<StoredSegment> GetSegment(const std::string& rig,
                                                   const SegmentKey& key) = 0;
  virtual absl::StatusOr<Listed<StoredSegment>> ListSegments(
      const std::string& rig, const SegmentQuery& query, const Page& page) = 0;
  // All, newest first.
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
  // Of one session by index. NOT_FOUND if nothing is kept of it.
  virtual absl::StatusOr<Listed<SessionSegment>> ListSessionSegments(
      const std::string& rig, const std::string& session, const Page& page) = 0;
  virtual absl::StatusOr<SessionSummary> GetSession(
      const std::string& rig, const std::string& session) = 0;
  // Why tables do not hold the segment, as far as that was written down.
  virtual absl::StatusOr<std::vector<TableAbsence>> ListAbsences(
      const std::string& rig, const SegmentKey& key) = 0;
  // The oldest unscored segments of all rigs, in the order of their arrival.
  struct Unscored {
    std::string rig;
    SegmentKey key;
    std::int64_t sequence;
  };
  virtual absl::StatusOr<std::vector<Unscored>> ListUnscored(int limit) = 0;
  virtual absl::StatusOr<std::vector<Table>> GetTables(
      const std::string& rig) = 0;

  virtual absl::StatusOr<StoredChange> GetChange(const std::string& rig,
                                                 std::int64_t change) = 0;

  // --- Calibrations.
  virtual absl::StatusOr<StoredCalibration> GetCalibration(
      const std::string& rig, std::int64_t version) = 0;
  virtual absl::StatusOr<StoredCalibration> GetActiveCalibration(
      const std::string& rig) = 0;
  virtual absl::StatusOr<Listed<StoredCalibration>> ListCalibrations(
      const std::string& rig, const Page& page) = 0;
  // The candidate that a run has stored; NOT_FOUND if it has none.
  virtual absl::StatusOr<StoredCalibration> GetCandidate(const std::string& rig,
                                                         std::int64_t run) = 0;

  // --- Runs.
  virtual absl::StatusOr<StoredRun> GetRun(const std::string& rig,
                                           std::int64_t run) = 0;
  virtual absl::StatusOr<Listed<StoredRun>> ListRuns(const std::string& rig,
                                                     const Page& page) = 0;
  // Pending or running runs of all rigs, oldest first: after a restart a
  // running one starts again.
  virtual absl::StatusOr<std::vector<StoredRun>> ListUnfinishedRuns() = 0;

  // --- Events, oldest or newest first; of one rig unless it is empty. They are
  // only ever appended.
  virtual absl::StatusOr<Listed<StoredEvent>> ListEvents(
      const Page& page, const std::string& rig = "") = 0;
  virtual absl::StatusOr<Listed<StoredEvent>> ListNewestEvents(
      const Page& page, const std::string& rig = "") = 0;

  // Check, backup and restore; null for an engine that has tools of its own for
  // them. Lives as long as the store.
  virtual StoreMaintenance* maintenance() { return nullptr; }
};

}  // namespace selfcal::server
