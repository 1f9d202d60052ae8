#include "server/metrics/event_metrics.h"

#include "server/pipeline/verdict.h"

namespace selfcal::server {
namespace {

using prometheus::Histogram;

const Histogram::BucketBoundaries kScoringSeconds = {
    1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1, 3, 10};
const Histogram::BucketBoundaries kRunSeconds = {
    0.01, 0.1, 0.5, 1, 5, 10, 30, 60, 120, 300, 600, 1800};
const Histogram::BucketBoundaries kEntropy_nats = {
    -80, -60, -50, -40, -30, -25, -20, -15, -10, -5, 0, 5, 10, 20};

const char* VerdictLabel(PipelineObserver::Verdict verdict) {
  switch (verdict) {
    case PipelineObserver::Verdict::kStored:
      return "stored";
    case PipelineObserver::Verdict::kDuplicate:
      return "duplicate";
    case PipelineObserver::Verdict::kRejected:
      return "rejected";
    case PipelineObserver::Verdict::kFailed:
      return "failed";
  }
  return "failed";
}

const char* OutcomeLabel(VerificationOutcome outcome) {
  switch (outcome) {
    case VerificationOutcome::kAgrees:
      return "agrees";
    case VerificationOutcome::kDiffers:
      return "differs";
    case VerificationOutcome::kNotCompared:
      return "not_compared";
  }
  return "not_compared";
}

prometheus::Labels CheckLabels(PipelineObserver::CheckSubject subject,
                               VerificationOutcome outcome) {
  const bool score = subject == PipelineObserver::CheckSubject::kScore;
  return {{"subject", score ? "score" : "calibration"},
          {"outcome", OutcomeLabel(outcome)}};
}

}  // namespace

EventMetrics::EventMetrics(Store* store,
                           RecentRigs* rigs,
                           prometheus::Registry* registry)
    : store_(store),
      rigs_(rigs),
      segments_(prometheus::BuildCounter()
                    .Name("selfcal_segments_total")
                    .Help("Segments received, by verdict; failed: no verdict, "
                          "because the store failed or the daemon stopped.")
                    .Register(*registry)),
      scoring_(prometheus::BuildHistogram()
                   .Name("selfcal_scoring_seconds")
                   .Help("Time to score one segment.")
                   .Register(*registry)
                   .Add({}, kScoringSeconds)),
      entropy_(prometheus::BuildHistogram()
                   .Name("selfcal_segment_entropy_nats")
                   .Help("Entropy of scored segments by group of parameters; "
                         "lower is more informative.")
                   .Register(*registry)),
      runs_(prometheus::BuildCounter()
                .Name("selfcal_runs_total")
                .Help("Runs that ended, by outcome.")
                .Register(*registry)),
      verdicts_(prometheus::BuildCounter()
                    .Name("selfcal_verdicts_total")
                    .Help("Versions that runs gave, by verdict.")
                    .Register(*registry)),
      run_seconds_(prometheus::BuildHistogram()
                       .Name("selfcal_run_seconds")
                       .Help("Time from the start of a run to its end.")
                       .Register(*registry)
                       .Add({}, kRunSeconds)),
      checks_(prometheus::BuildCounter()
                  .Name("selfcal_checks_total")
                  .Help("Scores and calibrations computed by both cores, by "
                        "outcome; differs: by more than rounding or "
                        "convergence explains.")
                  .Register(*registry)) {
  // Series that exist from the start show their first event as a step.
  for (const Verdict verdict : {Verdict::kStored,
                                Verdict::kDuplicate,
                                Verdict::kRejected,
                                Verdict::kFailed}) {
    segments_.Add({{"verdict", VerdictLabel(verdict)}});
  }
  for (const char* outcome : {"activated", "rejected", "failed", "cancelled"}) {
    runs_.Add({{"outcome", outcome}});
  }
  for (const VerdictKind kind :
       {VerdictKind::kGood, VerdictKind::kWeak, VerdictKind::kNotTrustworthy}) {
    verdicts_.Add({{"verdict", VerdictText(kind)}});
  }
  for (const CheckSubject subject :
       {CheckSubject::kScore, CheckSubject::kCalibration}) {
    for (const VerificationOutcome outcome :
         {VerificationOutcome::kAgrees,
          VerificationOutcome::kDiffers,
          VerificationOutcome::kNotCompared}) {
      checks_.Add(CheckLabels(subject, outcome));
    }
  }
}

void EventMetrics::OnVerdict(const std::string& rig, Verdict verdict) {
  segments_.Add({{"verdict", VerdictLabel(verdict)}}).Increment();
  const bool known =
      verdict == Verdict::kStored || verdict == Verdict::kDuplicate;
  if (known) rigs_->Heard(rig);
}

void EventMetrics::OnScore(const SegmentInformation& information,
                           double seconds) {
  scoring_.Observe(seconds);
  for (const GroupScore& group : information.groups) {
    entropy_.Add({{"group", GroupLabel(group.group)}}, kEntropy_nats)
        .Observe(group.entropy);
  }
}

void EventMetrics::OnRun(const StoredRun& run) {
  const auto now = std::chrono::steady_clock::now();
  const RunId id{run.rig, run.run};
  {
    const std::lock_guard lock(mutex_);
    const bool at_work =
        run.state == RunState::kPending || run.state == RunState::kRunning;
    if (at_work) {
      started_.emplace(id, now);
      return;
    }
    if (const auto started = started_.find(id); started != started_.end()) {
      const std::chrono::duration<double> took = now - started->second;
      run_seconds_.Observe(took.count());
      started_.erase(started);
    }
  }
  CountEnd(run);
}

void EventMetrics::OnCheck(CheckSubject subject, VerificationOutcome outcome) {
  checks_.Add(CheckLabels(subject, outcome)).Increment();
}

void EventMetrics::CountEnd(const StoredRun& run) {
  const auto count = [this](const char* outcome) {
    runs_.Add({{"outcome", outcome}}).Increment();
  };
  if (run.state == RunState::kCancelled) return count("cancelled");
  if (run.state == RunState::kFailed) return count("failed");
  const auto calibration =
      store_->GetCalibration(run.rig, run.calibration_version);
  const bool rejected =
      !calibration.ok() || calibration->state == CalibrationState::kRejected;
  count(rejected ? "rejected" : "activated");
  if (!calibration.ok()) return;
  verdicts_.Add({{"verdict", VerdictText(VerdictOf(*calibration).kind)}})
      .Increment();
}

}  // namespace selfcal::server
