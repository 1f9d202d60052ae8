#include "server/pipeline/pipeline.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <future>
#include <memory>
#include <tuple>
#include <utility>

#include "core/calibration/settled_ends.h"
#include "core/information/segment_scorer.h"
#include "core/model/image_bounds.h"
#include "core/model/saturation.h"
#include "server/pipeline/announcement_relay.h"
#include "server/pipeline/recalibration.h"
#include "server/pipeline/rescoring.h"
#include "server/pipeline/rig_claims.h"
#include "server/pipeline/scoring.h"
#include "server/pipeline/verification_sampler.h"
#include "server/pipeline/verifier.h"
#include "server/pipeline/watchers.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

constexpr char kVersionField[] = "calibration_version";

PipelineObserver::Verdict VerdictOf(
    const absl::StatusOr<SubmitResult>& result) {
  using Verdict = PipelineObserver::Verdict;
  if (!result.ok()) return Verdict::kFailed;
  switch (result->verdict) {
    case SubmitResult::Verdict::kStored:
      return Verdict::kStored;
    case SubmitResult::Verdict::kDuplicate:
      return Verdict::kDuplicate;
    case SubmitResult::Verdict::kRejected:
      return Verdict::kRejected;
  }
  return Verdict::kFailed;
}

// The estimators, with each score reported to the observer, if there is one.
Estimators ObserveScores(Estimators estimators, PipelineObserver* observer) {
  if (observer == nullptr) return estimators;
  const auto score = estimators.score;
  estimators.score = [=](const Rig& rig,
                         const Calibration& theta0,
                         const MotionSegment& segment) {
    const auto start = std::chrono::steady_clock::now();
    SegmentInformation information = score(rig, theta0, segment);
    const std::chrono::duration<double> took =
        std::chrono::steady_clock::now() - start;
    observer->OnScore(information, took.count());
    return information;
  };
  return estimators;
}

// The estimators, with each score offered to the sampler.
Estimators SampleScores(Estimators estimators, VerificationSampler* sampler) {
  const auto score = estimators.score;
  estimators.score = [=](const Rig& rig,
                         const Calibration& theta0,
                         const MotionSegment& segment) {
    SegmentInformation information = score(rig, theta0, segment);
    sampler->OnScore(rig, segment, information);
    return information;
  };
  return estimators;
}

std::function<void(const RunUpdate&)> ObserveRuns(
    PipelineObserver* observer, VerificationSampler* sampler) {
  return [observer, sampler](const RunUpdate& update) {
    if (observer != nullptr) observer->OnRun(update.run);
    sampler->OnRun(update.run);
  };
}

absl::StatusOr<SegmentInformation> ScoreByCore(
    ScorerKind scorer,
    const Rig& rig,
    const Calibration& theta0,
    const MotionSegment& segment,
    const std::function<bool()>& /*interrupted*/) {
  try {
    return ScoreSegmentBy(scorer, rig, theta0, segment);
  } catch (const std::exception& error) {
    return absl::InternalError(error.what());
  }
}

// `imu`: "imu", or "imu1" for the second one.
SubmitResult TooSaturated(const char* imu,
                          std::size_t samples,
                          std::size_t saturated) {
  return {SubmitResult::Verdict::kRejected,
          {{imu,
            fmt::format("{0} of {1} readings are at or beyond the full scale; "
                        "send rad/s and m/s^2, and state the range of the "
                        "sensors as {2}.gyro_max and {2}.accel_max of the rig",
                        saturated,
                        samples,
                        imu)}}};
}

// Connects the three kinds of threads, and does on the caller's thread what
// comes before them.
class PipelineImpl : public Pipeline {
 public:
  PipelineImpl(Domain* domain,
               const PipelineOptions& options,
               const Estimators& estimators)
      : domain_(domain),
        store_(domain->store()),
        options_(options),
        estimators_(estimators),
        coach_(store_),
        verifier_(domain,
                  options,
                  estimators,
                  [this](const std::string& rig) { relay_.PassOnActive(rig); }),
        sampler_(store_, options, &verifier_),
        run_watchers_(ObserveRuns(options.observer, &sampler_)),
        claims_(store_,
                options.replica,
                [this] {
                  scoring_.Wake();
                  recalibrator_.Wake();
                }),
        recalibrator_(domain,
                      &claims_,
                      options,
                      estimators,
                      &calibration_watchers_,
                      &run_watchers_),
        scoring_(
            domain,
            &claims_,
            options,
            SampleScores(ObserveScores(estimators, options.observer),
                         &sampler_),
            [this](const StoredRun& run) {
              spdlog::info("run {} of rig {} is due", run.run, run.rig);
              recalibrator_.Wake();
            },
            [this](const std::string& rig) { relay_.PassOnActive(rig); },
            [this](const std::string& rig) { recalibrator_.NoteScore(rig); }),
        relay_(store_,
               &claims_,
               &recalibrator_,
               &calibration_watchers_,
               &run_watchers_) {}

  // Interrupts a verification that is in progress.
  ~PipelineImpl() override { Stop(); }

  absl::Status Start() override {
    SELFCAL_RETURN_IF_ERROR(recalibrator_.Start());
    const absl::Status status = StartScoring();
    if (!status.ok()) Stop();
    return status;
  }

  void Stop() override {
    relay_.Stop();
    verifier_.Stop();
    scoring_.Stop();
    recalibrator_.Stop();
    claims_.Stop();  // once there is no more to write on behalf of a claim
    sampler_.Stop();
  }

  bool StoreResponds() override { return claims_.Responds(); }

  absl::StatusOr<SubmitResult> Submit(
      const std::string& rig,
      const MotionSegment& segment,
      const std::function<bool()>& cancelled) override {
    const auto result =
        std::make_shared<std::promise<absl::StatusOr<SubmitResult>>>();
    BeginSubmit(rig, segment, cancelled, [result](const auto& submitted) {
      result->set_value(submitted);
    });
    return result->get_future().get();
  }

  void BeginSubmit(const std::string& rig,
                   const MotionSegment& segment,
                   const std::function<bool()>& cancelled,
                   const SubmitDone& submitted) override {
    const SubmitDone done = Observed(rig, submitted);
    const absl::StatusOr<StoredRig> stored_rig = store_->GetRig(rig);
    if (!stored_rig.ok()) return done(stored_rig.status());
    const Calibration& factory = stored_rig->rig.factory;
    const ImuFullScale& full_scale = stored_rig->rig.imu_full_scale;
    const ImuFullScale& second_scale = stored_rig->rig.imu1_full_scale;
    const std::size_t stray =
        CountStrayObservations(segment, factory, options_.limits);
    std::size_t saturated = 0;
    for (const auto& [imu, samples, limit] :
         {std::tuple("imu", SamplesBetweenKeyframes(segment), full_scale),
          std::tuple(
              "imu1", SecondSamplesBetweenKeyframes(segment), second_scale)}) {
      const std::size_t of_imu = CountSaturatedReadings(samples, limit);
      if (IsTooSaturated(samples, of_imu)) {
        return done(TooSaturated(imu, samples.size(), of_imu));
      }
      saturated += of_imu;
    }
    if (stray == 0 && CountSaturatedReadings(segment.imu, full_scale) == 0 &&
        CountSaturatedReadings(segment.imu1, second_scale) == 0) {
      return BeginStore(rig, factory, segment, cancelled, done);
    }
    MotionSegment rest = segment;
    RemoveStrayObservations(factory, options_.limits, &rest);
    RemoveSaturatedReadings(full_scale, &rest.imu);
    RemoveSaturatedReadings(second_scale, &rest.imu1);
    BeginStore(rig,
               factory,
               rest,
               cancelled,
               [=](absl::StatusOr<SubmitResult> result) {
                 const bool stored =
                     result.ok() &&
                     result->verdict == SubmitResult::Verdict::kStored;
                 if (stored) {
                   result->observations_dropped = stray;
                   result->readings_dropped = saturated;
                 }
                 done(result);
               });
  }

  void EndSession(const std::string& rig) override {
    recalibrator_.EndSession(rig);
  }

  absl::StatusOr<StoredRig> UpdateRig(const std::string& rig,
                                      const RigChange& change,
                                      const std::string& caller,
                                      const std::string& reason) override {
    SELFCAL_ASSIGN_OR_RETURN(RigUpdate update,
                             domain_->UpdateRig(rig, change, caller, reason));
    spdlog::info("{} has changed rig {}", caller, rig);
    if (update.rescore) RescoreAtActive(domain_, estimators_, rig);
    return std::move(update.rig);
  }

  absl::Status DeleteRig(const std::string& rig,
                         const std::string& caller,
                         const std::string& reason) override {
    SELFCAL_RETURN_IF_ERROR(scoring_.Delete(
        rig, [&] { return domain_->DeleteRig(rig, caller, reason); }));
    spdlog::warn("{} has deleted rig {}: {}", caller, rig, reason);
    return absl::OkStatus();
  }

  absl::Status DeleteSegment(const std::string& rig,
                             const SegmentKey& key,
                             const std::string& caller,
                             const std::string& reason) override {
    SELFCAL_RETURN_IF_ERROR(scoring_.Delete(rig, [&]() -> absl::StatusOr<int> {
      SELFCAL_ASSIGN_OR_RETURN(
          const bool waiting, domain_->DeleteSegment(rig, key, caller, reason));
      return waiting ? 1 : 0;
    }));
    spdlog::warn("{} has deleted segment {}~{} of rig {}: {}",
                 caller,
                 key.session,
                 key.index,
                 rig,
                 reason);
    return absl::OkStatus();
  }

  absl::StatusOr<QuarantineCommit> QuarantineSegments(
      const std::string& rig,
      const std::string& session,
      std::optional<std::int64_t> index,
      const std::string& caller,
      const std::string& reason) override {
    const auto commit = scoring_.Quarantine(rig, [&] {
      return domain_->QuarantineSegments(rig, session, index, caller, reason);
    });
    if (!commit.ok()) return commit;
    spdlog::warn("{} quarantines segments of session {} of rig {} ({}): {}",
                 caller,
                 session,
                 rig,
                 commit->quarantined,
                 reason);
    return commit;
  }

  using Pipeline::StartRecalibration;
  absl::StatusOr<StoredRun> StartRecalibration(const std::string& rig,
                                               bool force) override {
    SELFCAL_ASSIGN_OR_RETURN(StoredRun run,
                             domain_->CreateManualRun(rig, force));
    recalibrator_.Wake();
    return run;
  }

  absl::StatusOr<StoredRun> CancelRecalibration(const std::string& rig,
                                                std::int64_t run) override {
    return recalibrator_.Cancel(rig, run);
  }

  absl::StatusOr<StoredCalibration> ActivateCalibration(
      const std::string& rig,
      std::int64_t version,
      const std::string& caller,
      const std::string& reason) override {
    SELFCAL_ASSIGN_OR_RETURN(
        StoredCalibration active,
        domain_->ActivateCalibration(rig, version, caller, reason));
    spdlog::warn("{} makes calibration {} of rig {} the active one: {}",
                 caller,
                 version,
                 rig,
                 reason);
    calibration_watchers_.Publish(active);
    RescoreAtActive(domain_, estimators_, rig);
    return active;
  }

  absl::StatusOr<ReportAnswer> TakeReport(const DeviceReport& report) override {
    auto answer = domain_->TakeReport(report);
    if (answer.ok()) relay_.PassOnRig(report.rig);
    return answer;
  }

  absl::StatusOr<RigCoaching> AdviseMotion(const std::string& rig) override {
    return coach_.Advise(rig);
  }

  absl::StatusOr<Verification> VerifyRig(
      const std::string& rig,
      const OnVerificationStep& on_step,
      const std::function<bool()>& interrupted) override {
    return verifier_.VerifyRig(rig, on_step, interrupted);
  }

  void ListenForDeletions(
      std::function<void(const std::string& rig)> deleted) override {
    relay_.ListenForDeletions(std::move(deleted));
  }

  absl::StatusOr<std::unique_ptr<Subscription>> WatchCalibration(
      const std::string& rig,
      std::function<void(const std::shared_ptr<const StoredCalibration>&)>
          callback) override {
    return calibration_watchers_.Watch(rig, std::move(callback), [&] {
      return store_->GetActiveCalibration(rig);
    });
  }

  absl::StatusOr<std::unique_ptr<Subscription>> WatchRun(
      const std::string& rig,
      std::int64_t run,
      std::function<void(const RunUpdate&)> callback) override {
    const auto now = [&]() -> absl::StatusOr<RunUpdate> {
      SELFCAL_ASSIGN_OR_RETURN(StoredRun stored, store_->GetRun(rig, run));
      RunUpdate update{std::move(stored)};
      update.missed = recalibrator_.StepsOf(rig, run);
      if (!update.missed.empty()) {
        update.progress = std::move(update.missed.back());
        update.missed.pop_back();
      }
      return update;
    };
    return run_watchers_.Watch(
        {rig, run},
        [callback = std::move(callback)](const auto& update) {
          callback(*update);
        },
        now);
  }

 private:
  absl::Status StartScoring() {
    SELFCAL_RETURN_IF_ERROR(scoring_.Start());
    SELFCAL_RETURN_IF_ERROR(claims_.Start());
    relay_.Start();
    sampler_.Start();
    return absl::OkStatus();
  }

  // Notifies the observer, if there is one, before `done`.
  SubmitDone Observed(const std::string& rig, const SubmitDone& done) const {
    PipelineObserver* observer = options_.observer;
    if (observer == nullptr) return done;
    return [observer, rig, done](const absl::StatusOr<SubmitResult>& result) {
      observer->OnVerdict(rig, VerdictOf(result));
      done(result);
    };
  }

  // BeginSubmit of a segment without stray observations, to a rig with this
  // factory calibration.
  void BeginStore(const std::string& rig,
                  const Calibration& factory,
                  const MotionSegment& segment,
                  const std::function<bool()>& cancelled,
                  const SubmitDone& done) {
    auto violations = Check(rig, factory, segment);
    if (!violations.ok()) return done(violations.status());
    if (!violations->empty()) {
      return done(SubmitResult{SubmitResult::Verdict::kRejected,
                               *std::move(violations)});
    }
    const absl::Status place = scoring_.TakePlace(rig, cancelled);
    if (!place.ok()) return done(place);
    recalibrator_.ContinueSession(rig);
    domain_->BeginPutSegment(rig, segment, [this, rig, done](const auto& v) {
      done(Settle(rig, v));
    });
  }

  // Fills the place in the backlog with the segment that was stored, or returns
  // the place.
  absl::StatusOr<SubmitResult> Settle(
      const std::string& rig, const absl::StatusOr<PutVerdict>& verdict) {
    if (verdict.ok() && *verdict == PutVerdict::kStored) {
      scoring_.FillPlace(rig);
      return SubmitResult{SubmitResult::Verdict::kStored, {}};
    }
    scoring_.ReturnPlace(rig);
    SELFCAL_RETURN_IF_ERROR(verdict.status());
    return SubmitResult{SubmitResult::Verdict::kDuplicate, {}};
  }

  // Every violation of a segment: those of its values, and of the version that
  // it names, which only the store knows.
  absl::StatusOr<std::vector<Violation>> Check(const std::string& rig_name,
                                               const Calibration& factory,
                                               const MotionSegment& segment) {
    std::vector<Violation> violations =
        Validate(segment, factory, options_.limits);
    const bool names_version =
        std::none_of(violations.begin(), violations.end(), [](const auto& v) {
          return v.field == kVersionField;
        });
    if (!names_version) {
      return violations;
    }
    const absl::StatusOr<bool> was_active =
        store_->WasActive(rig_name, segment.calibration_version);
    if (absl::IsNotFound(was_active.status())) {
      violations.push_back(
          {kVersionField,
           fmt::format("the rig has no version {}; send the one that the "
                       "states were estimated with",
                       segment.calibration_version)});
    } else if (!was_active.ok()) {
      return was_active.status();
    } else if (!*was_active) {
      violations.push_back(
          {kVersionField,
           fmt::format("version {} was never published; send the one that the "
                       "states were estimated with",
                       segment.calibration_version)});
    }
    return violations;
  }

  Domain* const domain_;
  Store* const store_;
  const PipelineOptions options_;
  const Estimators estimators_;
  RigCoach coach_;
  Verifier verifier_;
  VerificationSampler sampler_;
  Watchers<StoredCalibration> calibration_watchers_;
  Watchers<RunUpdate> run_watchers_;
  RigClaims claims_;
  Recalibrator recalibrator_;
  ScoringWorkers scoring_;
  AnnouncementRelay relay_;
};

}  // namespace

Estimators CoreEstimators() {
  return {
      [](const Rig& rig,
         const Calibration& theta0,
         const MotionSegment& segment) {
        // The workspace of a very long segment is not kept.
        constexpr std::size_t kMaxKeptKeyframes = 200;
        if (segment.keyframes.size() > kMaxKeptKeyframes) {
          return ScoreSegment(rig, theta0, segment);
        }
        // One workspace for each scoring thread, on the heap: in static
        // storage every thread of the process would hold one.
        thread_local const auto scorer = std::make_unique<SegmentScorer>();
        SegmentInformation information;
        scorer->Score(rig, theta0, segment, {}, &information);
        return information;
      },
      [](const Rig& rig,
         const Calibration& theta_start,
         const SegmentSource& segments,
         const CalibrateOptions& options,
         const ProgressCallback& progress,
         const std::function<bool()>&) -> absl::StatusOr<CalibrationResult> {
        SELFCAL_ASSIGN_OR_RETURN(const auto all, ReadAll(segments));
        return Calibrate(rig, theta_start, all, options, progress);
      },
      ScoreByCore,
      [](const Rig& rig,
         const Calibration& theta0,
         const MotionSegment& segment) {
        return SummariseSettledEnds(rig, theta0, segment);
      }};
}

std::unique_ptr<Pipeline> MakePipeline(Domain* domain,
                                       const PipelineOptions& options,
                                       const Estimators& estimators) {
  return std::make_unique<PipelineImpl>(domain, options, estimators);
}

}  // namespace selfcal::server
