// receive -> score -> select -> trigger -> recalibrate -> validate -> publish.
//
// Owns the worker threads: `scoring_threads` that score, one that recalibrates.
// Scores are committed in the order of arrival within a rig, so that tables do
// not depend on the number of threads. Knows no gRPC. Any thread may call.
// Nothing is kept only in memory: whatever is stored and unscored, or started
// and unfinished, is taken up by Start().
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
#include "server/store/store.h"

namespace selfcal::server {

// Whether now is a time for a run that nobody asked for by hand.
class Conditions {
 public:
  virtual ~Conditions() = default;
  // Why it is none, in words that stay the same while the reason does; empty if
  // it is one. Called from the pipeline's threads, often: returns at once.
  virtual std::string HoldReason() = 0;
};

struct PipelineOptions {
  int scoring_threads = 1;
  // Received, durable, but unscored segments beyond this make Submit wait.
  int max_backlog = 64;
  std::string program_version;
  SegmentLimits limits;
  CalibrateOptions calibrate;
  ScorerKind scorer = ScorerKind::kStructured;  // that Estimators::score is
  // Of new scores and calibrations, the share that is verified while the device
  // is idle (verification_sampler.h), in [0, 1].
  double verify_share = 0;
  PipelineObserver* observer = nullptr;  // must outlive the pipeline
  // Outlives the pipeline; none: every time is one.
  Conditions* conditions = nullptr;
  // How often runs that are held back are looked at again, and whether a
  // calibration has become old.
  std::chrono::milliseconds recheck = std::chrono::seconds(30);
  // A rig of which no segment arrives for so long has ended its session; 0:
  // only a caller ends one.
  std::chrono::milliseconds session_idle = std::chrono::minutes(1);
  // A run that takes longer fails.
  std::chrono::milliseconds max_run_time = std::chrono::minutes(30);
  // Nanoseconds since the Unix epoch.
  std::function<std::int64_t()> now_ns = NowNs;
};

// What the pipeline computes with. Called from its threads; what they throw
// ends the segment or the run, never the process.
struct Estimators {
  std::function<SegmentInformation(
      const Rig& rig, const Calibration& theta0, const MotionSegment& segment)>
      score;
  std::function<CalibrationResult(const Rig& rig,
                                  const Calibration& theta_start,
                                  const std::vector<MotionSegment>& segments,
                                  const CalibrateOptions& options,
                                  const ProgressCallback& progress,
                                  const std::function<bool()>& interrupted)>
      calibrate;
  // By either core, for a check. CANCELLED where it was interrupted.
  std::function<absl::StatusOr<SegmentInformation>(
      ScorerKind scorer,
      const Rig& rig,
      const Calibration& theta0,
      const MotionSegment& segment,
      const std::function<bool()>& interrupted)>
      score_by;
  // What is remembered of a segment; none: nothing is.
  std::function<SegmentEnds(
      const Rig& rig, const Calibration& theta0, const MotionSegment& segment)>
      ends = nullptr;
};

// ScoreSegment, Calibrate, ScoreSegmentBy and SummariseSettledEnds of core;
// they ask nobody whether they are interrupted, but for calls of `progress`.
Estimators CoreEstimators();

// The verdict on one segment; durable when it is kStored or kDuplicate.
struct SubmitResult {
  enum class Verdict { kStored, kDuplicate, kRejected };
  Verdict verdict = Verdict::kRejected;
  std::vector<Violation> violations;  // of a rejected one
};

// What a watcher of a run is told.
struct RunUpdate {
  StoredRun run;
  CalibrateProgress progress = {};
  // In the first update of a watcher: the iterations that it has missed.
  std::vector<CalibrateProgress> missed = {};
};

// A subscription; destroying it ends it (no callback runs after that). It may
// outlive the pipeline. Callbacks come from the pipeline's threads and hold
// them up: they hand over and return, and neither destroy their own
// subscription nor call the pipeline.
class Subscription {
 public:
  virtual ~Subscription() = default;
};

class Pipeline {
 public:
  virtual ~Pipeline() = default;

  // Takes up what a stop or a crash left, and starts the threads.
  virtual absl::Status Start() = 0;
  // Stops the threads: scoring after the segment at hand, a run by cancelling
  // it (it stays unfinished in the store and starts again at the next start).
  virtual void Stop() = 0;

  // Validates and stores one segment and wakes a worker. NOT_FOUND for an
  // unknown rig; errors of the store as they are. Blocks while the backlog is
  // full, until `cancelled` returns true (then CANCELLED). UNAVAILABLE while
  // the pipeline is not started. The segment must have been estimated with a
  // version of the rig that was published.
  virtual absl::StatusOr<SubmitResult> Submit(
      const std::string& rig,
      const MotionSegment& segment,
      const std::function<bool()>& cancelled) = 0;

  // The same without waiting for the disk, so that segments of one caller can
  // share a commit: it returns when the segment is refused or queued to be
  // written. `done` is called once, on any thread; it is short and calls
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

  // A caller has sent all it has of a session of the rig, which may call for a
  // run once it is scored (Domain::StartSessionRuns). Does not wait for that.
  virtual void EndSession(const std::string& rig) = 0;

  // Domain::UpdateRig; scores the stored segments anew if the prior has changed.
  virtual absl::StatusOr<StoredRig> UpdateRig(const std::string& rig,
                                              const RigChange& change,
                                              const std::string& caller) = 0;
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

  // On the tables as they are (Domain::CreateManualRun).
  virtual absl::StatusOr<StoredRun> StartRecalibration(const std::string& rig,
                                                       bool force) = 0;
  absl::StatusOr<StoredRun> StartRecalibration(const std::string& rig) {
    return StartRecalibration(rig, false);
  }
  // Returns once the run has ended. FAILED_PRECONDITION if it has ended another
  // way; UNAVAILABLE if the pipeline stops meanwhile: the run then starts
  // again.
  virtual absl::StatusOr<StoredRun> CancelRecalibration(const std::string& rig,
                                                        std::int64_t run) = 0;

  // Domain::ActivateCalibration, and tells the watchers.
  virtual absl::StatusOr<StoredCalibration> ActivateCalibration(
      const std::string& rig,
      std::int64_t version,
      const std::string& caller,
      const std::string& reason) = 0;

  // Which motion would teach the rig the most now: RigCoach::Advise
  // (coaching.h). The first call for a version takes as long as simulating a
  // segment of every motion.
  virtual absl::StatusOr<RigCoaching> AdviseMotion(const std::string& rig) = 0;

  // Computes the scores of all segments whose data is kept, and the active
  // calibration, by both cores on what is kept, and compares them; a difference
  // is kept as an event and with the version (Domain::ReportDisagreement). One
  // at a time: FAILED_PRECONDITION while another is under way. `interrupted` is
  // asked every few milliseconds; CANCELLED then. Takes minutes; `on_step` is
  // called on this thread.
  virtual absl::StatusOr<Verification> VerifyRig(
      const std::string& rig,
      const OnVerificationStep& on_step,
      const std::function<bool()>& interrupted) = 0;

  // The callback gets the active calibration of the rig at once (on the calling
  // thread), then each that becomes active, in the order in which they did:
  // each activation once.
  virtual absl::StatusOr<std::unique_ptr<Subscription>> WatchCalibration(
      const std::string& rig,
      std::function<void(const StoredCalibration&)> callback) = 0;

  // The callback gets the run as it is at once, then every change of state and
  // iteration, the end included.
  virtual absl::StatusOr<std::unique_ptr<Subscription>> WatchRun(
      const std::string& rig,
      std::int64_t run,
      std::function<void(const RunUpdate&)> callback) = 0;
};

// `domain` must outlive the pipeline.
std::unique_ptr<Pipeline> MakePipeline(
    Domain* domain,
    const PipelineOptions& options,
    Estimators estimators = CoreEstimators());

}  // namespace selfcal::server
