#include "core/calibration/calibration_run.h"

#include <algorithm>
#include <iomanip>
#include <sstream>
#include <utility>

#include "core/calibration/linear_range.h"
#include "core/calibration/noise_factors.h"
#include "core/calibration/noise_replica.h"
#include "core/calibration/partition.h"
#include "core/calibration/problem.h"
#include "core/calibration/screening.h"
#include "core/calibration/solver.h"
#include "core/calibration/structured_solver.h"
#include "core/calibration/subspace.h"
#include "core/calibration/theta_information.h"
#include "core/calibration/track_noise.h"

namespace selfcal {
namespace {

// Limits the number of rounds; usually they converge after two to four.
constexpr int kMaxRounds = 12;
// The first round only has to come near enough to detect outliers.
constexpr double kFirstTolerance = 1e-4;
constexpr double kTolerance = 1e-8;
// Largest undamped Gauss-Newton step of theta at convergence, in sigmas.
constexpr double kMaxStepSigmas = 0.05;
// A round ends after this many consecutive steps of theta below
// kSmallStepSigmas: landmarks of low weight may keep drifting for long without
// any effect; so may an unobservable scale of the scene, along which an
// undamped step goes far beyond its linear range.
constexpr int kSmallSteps = 3;
constexpr double kSmallStepSigmas = 0.005;
// Damping that is negligible for states that are determined.
constexpr double kSettledDamping = 1;
// A step is small only if it reduces the cost by less than this [half squares].
constexpr double kSmallDecrease = 0.1;
// Largest change of theta by a round at convergence, in sigmas.
constexpr double kMaxRoundSigmas = 0.02;
// Correlated pixel errors that increase the sigmas of theta by less than this
// fraction are treated as independent.
constexpr double kLeastTrackNoise = 0.05;
// Threshold in units of the prior. Directions with less information from the
// data are held constant until all others are estimated: from a poor start, the
// estimate would move along them out of the range of the linearisation.
constexpr double kWeakInformation = 100;

constexpr int kMaxReweightings = 4;
// Replicas with added noise, by which spurious information is detected.
constexpr int kReplicas = 3;
constexpr std::uint64_t kReplicaSeed = 1;

constexpr double Square(double x) { return x * x; }

constexpr char kNotDetermined[] =
    "the states of the keyframes are not determined";

// Each round selects landmarks and observations and whitens the inertial
// factors, from the current estimate alone, then solves that problem; the
// rounds end when one no longer moves theta. The result is thus a fixed point
// that does not depend on the path to it.
class Calibrator {
 public:
  Calibrator(const Rig& rig,
             const Calibration& theta_start,
             const std::vector<const MotionSegment*>& segments,
             const CalibrateOptions& options,
             const ProgressCallback& progress)
      : stated_(rig),
        rig_(rig),
        options_(options),
        progress_(progress),
        partitioning_(PartitionSegments(segments, options.merge_landmarks)),
        segments_(segments),
        problem_(FlattenSegments(rig, segments, partitioning_)),
        // A prior is centred at d = 0.
        reference_(options.prior ? options.prior->centre : theta_start),
        start_(theta_start),
        start_d_(BoxMinus(theta_start, reference_)),
        estimate_{start_d_, problem_.keyframes},
        subspace_(WholeSubspace(rig)) {
    result_.segments = static_cast<int>(segments.size());
    result_.partitions = static_cast<int>(partitioning_.partitions.size());
    result_.keyframes = static_cast<int>(problem_.keyframes.size());
  }

  CalibrationRun Run() {
    if (Start() && Solve() && ReweightNoise() && ReleaseWeak() &&
        HoldSpurious()) {
      Finish();
    }
    return {
        std::move(result_), std::move(evidence_), std::move(data_estimate_)};
  }

 private:
  // The following functions return false if the calibration ends without a
  // result: cancelled, or failed.
  bool Start() {
    Screen(nullptr);
    const ReprojectionStatistics before = Measure();
    result_.reprojection_rms_before_px = before.rms_px;
    result_.reprojection_median_before_px = before.median_px;
    if (!FindSubspace()) {
      return Fail(kNotDetermined);
    }
    result_.initial_cost = result_.final_cost = linearised_.cost;
    return true;
  }

  bool Solve() {
    result_.status = CalibrateStatus::kNotConverged;
    return options_.solver == SolverKind::kStructured ? SolveBySteps()
                                                      : SolveByRounds();
  }

  // The noise scales can be estimated only now that residuals are small.
  // Weighting by them moves the minimum slightly, and thereby the noise scales,
  // so that this is repeated.
  bool ReweightNoise() {
    for (int i = 0; result_.status == CalibrateStatus::kConverged; ++i) {
      if (!WeightByTrackNoise()) return false;
      if (result_.status != CalibrateStatus::kConverged ||
          !options_.noise_factors) {
        break;
      }
      EstimateNoise();
      if (!options_.reweight_noise || i == kMaxReweightings) break;
      const std::optional<Rig> next =
          Reweight(stated_, rig_, result_.noise_factors);
      if (!next) break;
      ApplyNoise(*next);
      if (!RepeatSelection() || !Solve()) return false;
    }
    return true;
  }

  void EstimateNoise() {
    const Eigen::MatrixXd basis = TangentBasis(rig_, subspace_);
    // The noise scales require weights without the track noise.
    std::vector<ScreenedLandmark> landmarks = screening_.landmarks;
    ScaleWeights(Square(screening_.track_noise_factor), &landmarks);
    // The estimation of the noise scales has its own linear system.
    linearised_.system.ReleaseChains();
    result_.noise_factors = EstimateNoiseFactors(
        stated_, Round(basis), estimate_, landmarks, track_noise_);
  }

  // The correlation along tracks is measured again with the new noise.
  void ApplyNoise(const Rig& next) {
    for (BiasLink& link : problem_.bias_links) {
      link.sigmas.head<3>() *= next.imu_noise.accel_bias_random_walk /
                               rig_.imu_noise.accel_bias_random_walk;
      link.sigmas.tail<3>() *= next.imu_noise.gyro_bias_random_walk /
                               rig_.imu_noise.gyro_bias_random_walk;
    }
    rig_ = next;
    result_.track_noise_factor = 1;
    SetTrackNoise(1, &screening_);
  }

  // Weights by the correlation of errors along tracks.
  bool WeightByTrackNoise() {
    if (!options_.correlated_tracks) {
      return true;
    }
    const Eigen::MatrixXd basis = TangentBasis(rig_, subspace_);
    track_noise_ = TrackNoiseFactor(
        Round(basis), linearised_, estimate_, screening_.landmarks);
    if (track_noise_ < 1 + kLeastTrackNoise) {
      return true;
    }
    result_.track_noise_factor = track_noise_;
    SetTrackNoise(track_noise_, &screening_);
    return RepeatSelection() && Solve();
  }

  // Until now all weakly observed directions are held constant. Those whose
  // linearisation holds within their sigma are estimated after all.
  bool ReleaseWeak() {
    if (subspace_.held.cols() == 0 ||
        result_.status != CalibrateStatus::kConverged) {
      return true;
    }
    const Eigen::MatrixXd nothing(start_d_.size(), 0);
    const LinearRange range(Round(nothing), estimate_, screening_.landmarks);
    if (!range.settled()) {
      return true;
    }
    Hold(TrustedSubspace(rig_, range, kWeakInformation));
    weak_assessed_ = true;
    Screen(&screening_);
    return UpdateInformation(&screening_.loss) ? Solve() && ReweightNoise()
                                               : Fail(kNotDetermined);
  }

  // Holds directions constant whose information stems from noise in states,
  // until none is left.
  bool HoldSpurious() {
    while (result_.status == CalibrateStatus::kConverged &&
           subspace_.estimated.cols() > 0) {
      const Eigen::MatrixXd spurious = SpuriousDirections();
      if (spurious.cols() == 0) break;
      Eigen::MatrixXd held(spurious.rows(),
                           subspace_.held.cols() + spurious.cols());
      held << subspace_.held, spurious;
      Hold(HoldDirections(rig_, information_.Lambda, held));
      weak_assessed_ = true;
      Screen(&screening_);
      if (!UpdateInformation(&screening_.loss)) return Fail(kNotDetermined);
      if (!Solve() || !ReweightNoise()) return false;
    }
    return true;
  }

  Eigen::MatrixXd SpuriousDirections() {
    const Eigen::MatrixXd nothing(start_d_.size(), 0);
    const SolverRound round = Round(nothing);
    linearised_.system.ReleaseChains();  // each replica has its own
    std::vector<Eigen::MatrixXd> under_noise;
    Eigen::MatrixXd spurious(start_d_.size(), 0);
    // The first replica usually shows that nothing is spurious.
    for (int i = 0; i < kReplicas && (i == 0 || spurious.cols() > 0); ++i) {
      const auto information = InformationUnderNoise(round,
                                                     segments_,
                                                     partitioning_,
                                                     estimate_,
                                                     screening_.landmarks,
                                                     result_.track_noise_factor,
                                                     kReplicaSeed + i);
      if (information) under_noise.push_back(*information);
      spurious = FindSpurious(rig_,
                              subspace_,
                              information_.Lambda,
                              under_noise,
                              i + 1 < kReplicas ? kMaybeSpurious : kSpurious);
    }
    return spurious;
  }

  // Screens and relinearises after every step.
  bool SolveBySteps() {
    if (!ReportProgress(0)) {
      return Cancel();
    }
    int small_steps = 0;
    for (;;) {
      const double undamped_sigmas = StepSigmas();
      const StepOutcome step = Step();
      if (!ReportProgress(moved_sigmas_)) {
        return Cancel();
      }
      const bool small = step.lower && moved_sigmas_ < kSmallStepSigmas &&
                         linearised_.cost - step.cost < kSmallDecrease;
      small_steps = small ? small_steps + 1 : 0;
      if (undamped_sigmas < kMaxStepSigmas) {
        result_.status = CalibrateStatus::kConverged;
        break;
      }
      if (!step.lower || small_steps == kSmallSteps) {
        result_.status = IsSettled() ? CalibrateStatus::kConverged
                                     : CalibrateStatus::kStalled;
        break;
      }
      if (result_.iterations >= options_.max_iterations) {
        break;
      }
      if (!RepeatSelection()) {
        return false;
      }
    }
    return true;
  }

  // Returns true if theta would not move, provided that weakly determined
  // states do not leave their linear range: in an undamped step these drag
  // theta along, and no such step is ever accepted.
  bool IsSettled() {
    const Eigen::MatrixXd basis = TangentBasis(rig_, subspace_);
    LinearisedRound damped;
    if (!LineariseRound(Round(basis),
                        estimate_,
                        screening_.landmarks,
                        &screening_.loss,
                        &damped,
                        kSettledDamping)) {
      return false;
    }
    const SharedInformation& at = damped.by_offset;
    remaining_sigmas_ =
        LargestInSigmas(SubspaceStep(rig_, subspace_, at.Lambda, at.eta),
                        SubspaceCovariance(rig_, subspace_, at.Lambda));
    return remaining_sigmas_ < kMaxStepSigmas;
  }

  // Repeats the selection of observations and of held directions. As holding a
  // direction moves the estimate, this is repeated until the subspace is
  // unchanged.
  bool RepeatSelection() {
    do {
      Screen(&screening_);
      if (!UpdateInformation(&screening_.loss)) {
        return Fail(kNotDetermined);
      }
    } while (!ChooseSubspace());
    return true;
  }

  bool SolveByRounds() {
    for (int round = 0; round < kMaxRounds; ++round) {
      const Eigen::VectorXd d_before = estimate_.d;
      const SolverOutcome outcome = SolveOneRound(round);
      if (outcome.status == SolverStatus::kCancelled) {
        return Cancel();
      }
      if (outcome.status == SolverStatus::kFailed) {
        return Fail(outcome.message);
      }
      if (!UpdateInformation(&screening_.loss)) {
        return Fail(kNotDetermined);
      }
      const double moved_sigmas =
          LargestInSigmas(estimate_.d - d_before, covariance_d_);
      const bool whole = ChooseSubspace();
      if (round > 0 && whole && moved_sigmas < kMaxRoundSigmas &&
          StepSigmas() < kMaxStepSigmas) {
        result_.status = CalibrateStatus::kConverged;
        break;
      }
      if (result_.iterations >= options_.max_iterations) {
        break;
      }
      Screen(nullptr);
    }
    return true;
  }

  bool ReportProgress(double step_sigmas) const {
    return ReportProgress(
        result_.iterations, result_.final_cost, step_sigmas, estimate_.d);
  }

  bool ReportProgress(int iteration,
                      double cost,
                      double step_sigmas,
                      const Eigen::VectorXd& d) const {
    if (!progress_) {
      return true;
    }
    const Calibration theta = BoxPlus(reference_, d);
    const Eigen::VectorXd variances =
        CovarianceWithHeld(rig_, subspace_, information_.Lambda).diagonal();
    return progress_({.iteration = iteration,
                      .max_iterations = options_.max_iterations,
                      .cost = cost,
                      .step_sigmas = step_sigmas,
                      .theta = theta,
                      .moved = BoxMinus(theta, start_),
                      .sigmas = variances.cwiseMax(0).cwiseSqrt()});
  }

  bool Cancel() {
    result_.status = CalibrateStatus::kCancelled;
    result_.message = "cancelled";
    return false;
  }

  bool Fail(const std::string& message) {
    result_.status = CalibrateStatus::kFailed;
    result_.message = message;
    return false;
  }

  Calibration Theta() const { return BoxPlus(reference_, estimate_.d); }

  // Repeats the selection of everything that the next round is based on.
  void Screen(const Screening* before) {
    const Calibration theta = Theta();
    MeasureMotions(rig_, theta, problem_, estimate_.keyframes, &motions_);
    screening_ = ScreenLandmarks(
        rig_, theta, problem_, estimate_.keyframes, motions_, options_, before);
    RefineOnWhatIsUsed(
        rig_, theta, problem_, estimate_.keyframes, motions_, &screening_);
    SetTrackNoise(result_.track_noise_factor, &screening_);
    whitening_ =
        WhitenInertialLinks(rig_, theta.imu, problem_, estimate_.keyframes);
  }

  ReprojectionStatistics Measure() const {
    return MeasureReprojection(rig_,
                               Theta(),
                               problem_,
                               estimate_.keyframes,
                               motions_,
                               screening_.landmarks);
  }

  // Updates information and covariance of the offset d at the estimate. Returns
  // false if states are not determined.
  bool UpdateInformation(const RobustLoss* loss) {
    const Eigen::MatrixXd basis = TangentBasis(rig_, subspace_);
    if (!LineariseRound(Round(basis),
                        estimate_,
                        screening_.landmarks,
                        loss,
                        &linearised_)) {
      return false;
    }
    information_ = linearised_.by_offset;
    covariance_d_ = SubspaceCovariance(rig_, subspace_, information_.Lambda);
    return covariance_d_.allFinite();
  }

  // All residuals are large at a start far from the optimum, so that
  // observability is assessed without their robust weights. As weights can only
  // reduce information, this is unnecessary if everything is observed with
  // them.
  bool FindSubspace() {
    if (!UpdateInformation(&screening_.loss)) {
      return false;
    }
    if (ChooseSubspace()) {
      return true;
    }
    subspace_ = WholeSubspace(rig_);
    estimate_.d = start_d_;
    if (!UpdateInformation(nullptr)) {
      return false;
    }
    ChooseSubspace();
    return UpdateInformation(&screening_.loss);
  }

  // Holds directions that the data does not observe at their start value.
  // Returns true if the size of the estimated subspace did not change.
  bool ChooseSubspace() {
    const auto held = static_cast<int>(subspace_.held.cols());
    ThetaSubspace observed =
        weak_assessed_
            ? HoldDirections(rig_, information_.Lambda, subspace_.held)
            : ObservedSubspace(
                  rig_, information_.Lambda, held, kWeakInformation);
    const bool same = observed.held.cols() == held;
    if (!same) {
      Hold(std::move(observed));
    }
    return same;
  }

  void Hold(ThetaSubspace subspace) {
    subspace_ = std::move(subspace);
    estimate_.d =
        start_d_ + ProjectOnSubspace(rig_, subspace_, estimate_.d - start_d_);
    covariance_d_ = SubspaceCovariance(rig_, subspace_, information_.Lambda);
  }

  SolverRound Round(const Eigen::MatrixXd& basis) const {
    return {.rig = rig_,
            .reference = reference_,
            .problem = problem_,
            .motions = motions_,
            .whitening = whitening_,
            .basis = basis,
            .loss = screening_.loss,
            .prior_information =
                options_.prior ? &options_.prior->information : nullptr,
            .threads = options_.threads};
  }

  StepOutcome Step() {
    const Eigen::MatrixXd basis = TangentBasis(rig_, subspace_);
    const Eigen::VectorXd d_before = estimate_.d;
    const StepOutcome step =
        TakeStep(Round(basis), linearised_, &estimate_, &screening_.landmarks);
    result_.final_cost = step.cost;
    ++result_.iterations;
    moved_sigmas_ = LargestInSigmas(estimate_.d - d_before, covariance_d_);
    return step;
  }

  SolverOutcome SolveOneRound(int round_number) {
    const Eigen::MatrixXd basis = TangentBasis(rig_, subspace_);
    SolverRound round = Round(basis);
    round.max_iterations = options_.max_iterations - result_.iterations;
    round.function_tolerance = round_number == 0 ? kFirstTolerance : kTolerance;
    Eigen::VectorXd d_last = estimate_.d;
    int small_steps = 0;
    const auto report =
        [&](int iteration, double cost, const Eigen::VectorXd& d) {
          const double step = LargestInSigmas(d - d_last, covariance_d_);
          d_last = d;
          // A rejected step does not move theta, and is ignored.
          if (step > 0) {
            small_steps = step < kSmallStepSigmas ? small_steps + 1 : 0;
          }
          if (!ReportProgress(result_.iterations + iteration, cost, step, d)) {
            return SolverSignal::kCancel;
          }
          return small_steps >= kSmallSteps ? SolverSignal::kEnough
                                            : SolverSignal::kGoOn;
        };
    const SolverOutcome outcome = SolveRound(
        options_.solver, round, report, &estimate_, &screening_.landmarks);
    if (round_number == 0) {
      result_.initial_cost = outcome.initial_cost;
    }
    result_.final_cost = outcome.final_cost;
    result_.iterations += outcome.iterations;
    return outcome;
  }

  double StepSigmas() const {
    return LargestInSigmas(
        SubspaceStep(rig_, subspace_, information_.Lambda, information_.eta),
        covariance_d_);
  }

  void Finish() {
    if (result_.status == CalibrateStatus::kStalled) {
      std::ostringstream message;
      message << std::setprecision(2)
              << "no step lowers the cost, and the next one would move theta "
                 "by "
              << remaining_sigmas_ << " sigma";
      result_.message = message.str();
    } else if (result_.status != CalibrateStatus::kConverged) {
      result_.status = CalibrateStatus::kNotConverged;
      result_.message = "the estimate still moves after " +
                        std::to_string(result_.iterations) + " iterations";
    }
    result_.theta = Theta();
    const Eigen::MatrixXd by_offset = ThetaByOffset(reference_, estimate_.d);
    result_.covariance =
        by_offset * CovarianceWithHeld(rig_, subspace_, information_.Lambda) *
        by_offset.transpose();
    result_.Lambda = linearised_.system.information().Lambda;
    result_.rank = static_cast<int>(subspace_.estimated.cols());
    result_.held_constant = subspace_.unobserved;
    const Eigen::MatrixXd basis = TangentBasis(rig_, subspace_);
    // Same cost function as for the initial cost: without the weights for
    // correlated tracks.
    SetTrackNoise(1, &screening_);
    result_.final_cost =
        RoundCost(Round(basis), estimate_, screening_.landmarks);
    for (NoiseFactor& factor : result_.noise_factors) {
      factor.used = NoiseOf(factor.kind, rig_) / NoiseOf(factor.kind, stated_);
      factor.factor *= factor.used;
    }
    TestSegments();
    const ReprojectionStatistics after = Measure();
    result_.reprojection_rms_after_px = after.rms_px;
    result_.reprojection_median_after_px = after.median_px;
    result_.landmarks = static_cast<int>(screening_.landmarks.size());
    result_.landmarks_dropped = screening_.landmarks_dropped;
    result_.observations = screening_.observations;
    result_.observations_dropped = screening_.observations_dropped;
  }

  // Tests each segment alone, at the minimum. If they disagree by more than
  // their information predicts, the covariance is scaled accordingly.
  void TestSegments() {
    Rig rig = rig_;
    rig.pixel_sigma_px *= result_.track_noise_factor;
    evidence_ = CollectEvidence(rig,
                                result_.theta,
                                segments_,
                                problem_,
                                estimate_.keyframes,
                                screening_,
                                subspace_,
                                ExpectedReprojectionSquares());
    const double excess = TestEach(&evidence_);
    result_.covariance *= excess;
    data_estimate_ = {.reference = reference_,
                      .d = estimate_.d,
                      .subspace = subspace_,
                      .Lambda = information_.Lambda,
                      .excess = excess,
                      .noise_factor = LargestNoise(result_.noise_factors,
                                                   result_.track_noise_factor)};
    result_.halves = TestHalves(evidence_, excess);
    for (const SegmentEvidence& one : evidence_) {
      result_.segment_fits.push_back(one.fit);
    }
  }

  // Expected sum over the two rows of a reprojection, from the redundancy of
  // all; 0: unknown.
  double ExpectedReprojectionSquares() const {
    for (const NoiseFactor& factor : result_.noise_factors) {
      if (factor.kind == NoiseKind::kPixel) {
        return factor.redundancy / std::max(1, screening_.observations);
      }
    }
    return 0;
  }

  const Rig& stated_;
  Rig rig_;  // with the noise by which everything is weighted
  const CalibrateOptions& options_;
  const ProgressCallback& progress_;
  Partitioning partitioning_;
  const std::vector<const MotionSegment*>& segments_;
  CalibrationProblem problem_;
  Calibration reference_;
  Calibration start_;
  Eigen::VectorXd start_d_;
  CalibrationEstimate estimate_;
  ThetaSubspace subspace_;
  KeyframeMotions motions_;
  Screening screening_;
  std::vector<InertialMatrix> whitening_;
  LinearisedRound linearised_;
  SharedInformation information_;
  Eigen::MatrixXd covariance_d_;
  bool weak_assessed_ = false;
  double moved_sigmas_ = 0;      // by the last step
  double remaining_sigmas_ = 0;  // remaining step of a stalled estimate
  double track_noise_ = 0;       // as TrackNoiseFactor
  CalibrationResult result_;
  std::vector<SegmentEvidence> evidence_;
  DataEstimate data_estimate_;
};

}  // namespace

CalibrationRun RunCalibration(const Rig& rig,
                              const Calibration& theta_start,
                              const std::vector<const MotionSegment*>& segments,
                              const CalibrateOptions& options,
                              const ProgressCallback& progress) {
  return Calibrator(rig, theta_start, segments, options, progress).Run();
}

}  // namespace selfcal
