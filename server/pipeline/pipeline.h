// receive -> score -> select -> trigger -> recalibrate -> validate -> publish.
//
// Owns the worker threads: `scoring_threads` that score, `solver_processes`
// that recalibrate, and one that verifies a sample of the results. Scores are
// committed in the order of arrival within a rig, so that tables do not depend
// on the number of threads; rigs take turns. Where several daemons share the
// database, each does the work of the rigs that it has claimed, and all answer
// for all rigs. Independent of gRPC. Any thread
// may call. Nothing is kept only in memory: segments that are stored and
// unscored, and runs that are unfinished, are resumed by Start().
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/information/segment_information.h"
#include "core/model/segment.h"
#include "core/verify/scorer.h"
#include "server/domain/domain.h"
#include "server/pipeline/coaching.h"
#include "server/pipeline/observer.h"
#include "server/pipeline/verification.h"
#include "server/store/segment_source.h"
#include "server/store/store.h"

namespace selfcal::server {

// Conditions for runs that were not started manually.
class Conditions {
 public:
  virtual ~Conditions() = default;
  // Why such a run is deferred now, in words that stay the same while the
  // reason does; empty if it is not. Called often, from the pipeline's threads:
  // must return at once.
  virtual std::string DeferReason() = 0;
};

// Settings of a daemon that shares its database with others (rig_claims.h).
struct ReplicaOptions {
  bool shared = false;
  // Interval at which it shows the others that it runs, and looks for work that
  // they leave to it.
  std::chrono::milliseconds beat = std::chrono::seconds(1);
  // Another daemon that shows nothing for longer is taken for dead.
  std::chrono::milliseconds lease = std::chrono::seconds(10);
};

struct PipelineOptions {
  ReplicaOptions replica;
  int scoring_threads = 1;
  // Runs of different rigs that are computed at once.
  int solver_processes = 1;
  // Submit waits while more segments than this are stored and unscored, unless
  // none of them is of the same rig (backlog.h).
  int max_backlog = 64;
  std::string program_version;
  SegmentLimits limits;
  CalibrateOptions calibrate;
  ScorerKind scorer = ScorerKind::kStructured;  // what Estimators::score uses
  // Share of new scores and calibrations that is verified while the device is
  // idle (verification_sampler.h), in [0, 1].
  double verify_share = 0;
  PipelineObserver* observer = nullptr;  // must outlive the pipeline
  // Must outlive the pipeline; null: no run is deferred for conditions.
  Conditions* conditions = nullptr;
  // Interval of looking again at deferred runs and at the age of calibrations.
  std::chrono::milliseconds recheck = std::chrono::seconds(30);
  // The session of a rig has ended when no segment of it arrives for this time;
  // 0: only a caller ends it.
  std::chrono::milliseconds session_idle = std::chrono::minutes(1);
  // A run that takes longer fails.
  std::chrono::milliseconds max_run_time = std::chrono::minutes(30);
  // Steady time (Moment), for ages.
  std::function<std::int64_t()> now_ns = NowNs;
};

// The computations of the pipeline. Called from its threads; what they throw
// ends the segment or the run, never the process.
struct Estimators {
  std::function<SegmentInformation(
      const Rig& rig, const Calibration& theta0, const MotionSegment& segment)>
      score;
  // An error is that of `segments`.
  std::function<absl::StatusOr<CalibrationResult>(
      const Rig& rig,
      const Calibration& theta_start,
      const SegmentSource& segments,
      const CalibrateOptions& options,
      const ProgressCallback& progress,
      const std::function<bool()>& interrupted)>
      calibrate;
  // Scores by either core, for a verification. CANCELLED if it was interrupted.
  std::function<absl::StatusOr<SegmentInformation>(
      ScorerKind scorer,
      const Rig& rig,
      const Calibration& theta0,
      const MotionSegment& segment,
      const std::function<bool()>& interrupted)>
      score_by;
  // The ends of a segment, which are remembered; null: nothing is.
  std::function<SegmentEnds(
      const Rig& rig, const Calibration& theta0, const MotionSegment& segment)>
      ends = nullptr;
};

// ScoreSegment, Calibrate, ScoreSegmentBy and SummariseSettledEnds of core.
// They do not poll `interrupted`; only `progress` can end a calibration.
Estimators CoreEstimators();

// The verdict on one segment; durable when it is kStored or kDuplicate.
struct SubmitResult {
  enum class Verdict { kStored, kDuplicate, kRejected };
  Verdict verdict = Verdict::kRejected;
  std::vector<Violation> violations;  // if rejected
  // Observations outside the image that were left out of what is stored.
  std::size_t observations_dropped = 0;
  // Saturated readings of the IMU that were left out.
  std::size_t readings_dropped = 0;
};

// An update to the watchers of a run.
struct RunUpdate {
  StoredRun run;
  CalibrateProgress progress = {};
  // In the first update of a watcher, the iterations before it.
  std::vector<CalibrateProgress> missed = {};
};

// A subscription, which ends when it is destroyed (no callback runs after
// that). It may outlive the pipeline. Callbacks come from the pipeline's
// threads and hold them up: they must pass the update on and return, and must
// neither destroy their own subscription nor call the pipeline.
class Subscription {
 public:
  virtual ~Subscription() = default;
};

class Pipeline {
 public:
  virtual ~Pipeline() = default;

  // Resumes what a stop or a crash left unfinished, and starts the threads.
  virtual absl::Status Start() = 0;
  // Stops the threads: scoring after the current segments, a run by
  // interrupting it (it stays unfinished in the store and starts again at the
  // next start).
  virtual void Stop() = 0;

  // False while a database that daemons share does not respond.
  virtual bool StoreResponds() { return true; }

  // Validates and stores one segment and wakes a worker. NOT_FOUND for an
  // unknown rig; errors of the store are passed on. Blocks while the backlog is
  // full, until `cancelled` returns true (then CANCELLED). UNAVAILABLE while
  // the pipeline is not started. The segment must have been estimated with a
  // published version of the rig, or it is rejected. A few observations outside
  // the image, and saturated readings of the IMU, do not reject it: they are
  // not stored (image_bounds.h, saturation.h).
  virtual absl::StatusOr<SubmitResult> Submit(
      const std::string& rig,
      const MotionSegment& segment,
      const std::function<bool()>& cancelled) = 0;

  // Submit without waiting for the disk, so that segments of one caller can
  // share a commit: returns when the segment is refused or queued to be
  // written. `done` is called once, on any thread; it must be short and call
  // neither the pipeline nor the store. Segments of one caller are stored in
  // the order of its calls.
  using SubmitDone =
      std::function<void(const absl::StatusOr<SubmitResult>& result)>;
  virtual void BeginSubmit(const std::string& rig,
                           const MotionSegment& segment,
                           const std::function<bool()>& cancelled,
                           const SubmitDone& done) {
    done(Submit(rig, segment, cancelled));
  }

  // Notes that a caller has sent all segments of a session of the rig. That may
  // start a run once they are scored (Domain::StartSessionRuns), for which this
  // does not wait.
  virtual void EndSession(const std::string& rig) = 0;

  // Domain::UpdateRig; rescores the stored segments if the sigmas of the prior
  // have changed.
  virtual absl::StatusOr<StoredRig> UpdateRig(const std::string& rig,
                                              const RigChange& change,
                                              const std::string& caller,
                                              const std::string& reason) = 0;
  // Domain::DeleteRig, once no segment of the rig is being scored.
  virtual absl::Status DeleteRig(const std::string& rig,
                                 const std::string& caller,
                                 const std::string& reason) = 0;
  // Domain::DeleteSegment, once no segment of the rig is being scored.
  virtual absl::Status DeleteSegment(const std::string& rig,
                                     const SegmentKey& key,
                                     const std::string& caller,
                                     const std::string& reason) = 0;

  // Domain::QuarantineSegments.
  virtual absl::StatusOr<QuarantineCommit> QuarantineSegments(
      const std::string& rig,
      const std::string& session,
      std::optional<std::int64_t> index,
      const std::string& caller,
      const std::string& reason) = 0;

  // Creates a run on the present tables (Domain::CreateManualRun).
  virtual absl::StatusOr<StoredRun> StartRecalibration(const std::string& rig,
                                                       bool force) = 0;
  absl::StatusOr<StoredRun> StartRecalibration(const std::string& rig) {
    return StartRecalibration(rig, false);
  }
  // Returns once the run has ended. FAILED_PRECONDITION if it ended in another
  // way; UNAVAILABLE if the pipeline stops meanwhile, in which case the run
  // starts again.
  virtual absl::StatusOr<StoredRun> CancelRecalibration(const std::string& rig,
                                                        std::int64_t run) = 0;

  // Domain::ActivateCalibration, then notifies the watchers.
  virtual absl::StatusOr<StoredCalibration> ActivateCalibration(
      const std::string& rig,
      std::int64_t version,
      const std::string& caller,
      const std::string& reason) = 0;

  // Domain::TakeReport, then notifies the watchers.
  virtual absl::StatusOr<ReportAnswer> TakeReport(
      const DeviceReport& report) = 0;

  // The most informative next motion: RigCoach::Advise (coaching.h). The first
  // call for a version takes as long as simulating a segment of every motion.
  virtual absl::StatusOr<RigCoaching> AdviseMotion(const std::string& rig) = 0;

  // Computes the scores of all segments whose data is kept, and the active
  // calibration, by both cores on the data that is kept, and compares them. A
  // difference is recorded in an event and with the version
  // (Domain::ReportDisagreement). FAILED_PRECONDITION while another
  // verification is in progress. `interrupted` is polled often; CANCELLED then.
  // Takes minutes; `on_step` is called on this thread.
  virtual absl::StatusOr<Verification> VerifyRig(
      const std::string& rig,
      const OnVerificationStep& on_step,
      const std::function<bool()>& interrupted) = 0;

  // `deleted` is called with a rig that may have been deleted, by whichever
  // daemon or by a report, before watchers learn of another rig of that name;
  // with an empty name, any may have been. It may read the store, on a thread
  // that it may hold up. DeleteRig does not call it.
  virtual void ListenForDeletions(
      std::function<void(const std::string& rig)> deleted) = 0;

  // The callback receives the active calibration of the rig at once (on the
  // calling thread), then each one that becomes active, in that order: each
  // activation once, and none of another rig that has the name later. All
  // watchers share the record of an activation.
  virtual absl::StatusOr<std::unique_ptr<Subscription>> WatchCalibration(
      const std::string& rig,
      std::function<void(const std::shared_ptr<const StoredCalibration>&)>
          callback) = 0;

  // The callback receives the run in its present state at once, then every
  // change of state and iteration, including the end.
  virtual absl::StatusOr<std::unique_ptr<Subscription>> WatchRun(
      const std::string& rig,
      std::int64_t run,
      std::function<void(const RunUpdate&)> callback) = 0;
};

// `domain` must outlive the pipeline.
std::unique_ptr<Pipeline> MakePipeline(
    Domain* domain,
    const PipelineOptions& options,
    const Estimators& estimators = CoreEstimators());

}  // namespace selfcal::server
