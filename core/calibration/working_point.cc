#include "core/calibration/working_point.h"

#include <utility>

#include "core/calibration/theta_information.h"

namespace selfcal {
WorkingPoint::WorkingPoint(const Rig& rig,
                           const Calibration& theta_start,
                           CalibrationProblem problem,
                           const CalibrateOptions& options)
    : rig_(rig),
      problem_(std::move(problem)),
      options_(options),
      // A prior is centred at d = 0.
      reference_(options.prior ? options.prior->centre : theta_start),
      start_d_(BoxMinus(theta_start, reference_)),
      estimate_{start_d_, problem_.keyframes},
      subspace_(WholeSubspace(rig)),
      loss_{.kind = options.loss, .scale = options.loss_scale} {
  SelectAfresh();
}

SolverRound WorkingPoint::Round(const Eigen::MatrixXd& basis) const {
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

SolverRound WorkingPoint::RoundOfNoise(const Eigen::MatrixXd& basis) const {
  SolverRound round = Round(basis);
  round.loss.scale = options_.loss_scale;
  return round;
}

ReprojectionStatistics WorkingPoint::MeasureReprojections() const {
  return MeasureReprojection(rig_,
                             theta(),
                             problem_,
                             estimate_.keyframes,
                             motions_,
                             screening_.landmarks);
}

double WorkingPoint::UnweightedCost() {
  const Eigen::MatrixXd basis = TangentBasis(rig_, subspace_);
  SetTrackNoise(1, &screening_);
  return RoundCost(Round(basis), estimate_, screening_.landmarks);
}

double WorkingPoint::StepSigmas() const {
  const SharedInformation& about = information();
  return LargestInSigmas(SubspaceStep(rig_, subspace_, about.Lambda, about.eta),
                         covariance_);
}

// All residuals are large at a start far from the optimum, so that
// observability is assessed without their robust weights. As weights can only
// reduce information, this is unnecessary if everything is observed with them.
bool WorkingPoint::FindSubspace() {
  if (!Linearise()) return false;
  if (ChooseSubspace()) return true;
  subspace_ = WholeSubspace(rig_);
  estimate_.d = start_d_;
  if (!LineariseBy(nullptr)) return false;
  ChooseSubspace();
  return Linearise();
}

void WorkingPoint::Select() { SelectFrom(&screening_); }

void WorkingPoint::SelectAfresh() { SelectFrom(nullptr); }

void WorkingPoint::SelectFrom(const Screening* before) {
  const Calibration at = theta();
  MeasureMotions(rig_, at, problem_, estimate_.keyframes, &motions_);
  screening_ = ScreenLandmarks(
      rig_, at, problem_, estimate_.keyframes, motions_, loss_, before);
  RefineOnWhatIsUsed(
      rig_, at, problem_, estimate_.keyframes, motions_, &screening_);
  SetTrackNoise(track_noise_factor_, &screening_);
  whitening_ = WhitenInertialLinks(
      rig_, ChainThetas(at, problem_), problem_, estimate_.keyframes);
}

bool WorkingPoint::Linearise() { return LineariseBy(&screening_.loss); }

bool WorkingPoint::LineariseBy(const RobustLoss* loss) {
  const Eigen::MatrixXd basis = TangentBasis(rig_, subspace_);
  if (!LineariseRound(
          Round(basis), estimate_, screening_.landmarks, loss, &linearised_)) {
    return false;
  }
  covariance_ = SubspaceCovariance(rig_, subspace_, information().Lambda);
  return covariance_.allFinite();
}

bool WorkingPoint::ChooseSubspace() {
  const auto held = static_cast<int>(subspace_.held.cols());
  const int least_held = std::exchange(reweighted_, false) ? 0 : held;
  ThetaSubspace observed =
      assessed_ ? HoldDirections(rig_, information().Lambda, subspace_.held)
                : ObservedSubspace(
                      rig_, information().Lambda, least_held, kWeakInformation);
  const bool same = observed.held.cols() == held;
  if (!same) Hold(std::move(observed));
  return same;
}

bool WorkingPoint::RepeatSelection() {
  do {
    Select();
    if (!Linearise()) return false;
  } while (!ChooseSubspace());
  return true;
}

void WorkingPoint::Hold(ThetaSubspace subspace) {
  subspace_ = std::move(subspace);
  estimate_.d =
      start_d_ + ProjectOnSubspace(rig_, subspace_, estimate_.d - start_d_);
  covariance_ = SubspaceCovariance(rig_, subspace_, information().Lambda);
}

bool WorkingPoint::HoldAssessed(ThetaSubspace subspace) {
  Hold(std::move(subspace));
  assessed_ = true;
  Select();
  return Linearise();
}

void WorkingPoint::WeightByNoise(const Rig& rig, double residuals) {
  for (BiasLink& link : problem_.bias_links) {
    link.sigmas.head<3>() *= rig.imu_noise.accel_bias_random_walk /
                             rig_.imu_noise.accel_bias_random_walk;
    link.sigmas.tail<3>() *= rig.imu_noise.gyro_bias_random_walk /
                             rig_.imu_noise.gyro_bias_random_walk;
  }
  rig_ = rig;
  loss_.scale = options_.loss_scale * residuals;
  reweighted_ = true;
  WeightByTracks(1);
}

void WorkingPoint::WeightByTracks(double track_noise_factor) {
  track_noise_factor_ = track_noise_factor;
  SetTrackNoise(track_noise_factor, &screening_);
}

StepOutcome WorkingPoint::Step() {
  const Eigen::MatrixXd basis = TangentBasis(rig_, subspace_);
  return TakeStep(Round(basis), linearised_, &estimate_, &screening_.landmarks);
}

SolverOutcome WorkingPoint::SolveRound(int max_iterations,
                                       double tolerance,
                                       const SolverCallback& callback) {
  const Eigen::MatrixXd basis = TangentBasis(rig_, subspace_);
  SolverRound round = Round(basis);
  round.max_iterations = max_iterations;
  round.function_tolerance = tolerance;
  return selfcal::SolveRound(
      options_.solver, round, callback, &estimate_, &screening_.landmarks);
}

}  // namespace selfcal
