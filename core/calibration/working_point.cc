#include "core/calibration/working_point.h"

#include <utility>

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
      directions_(rig),
      selection_({.kind = options.loss, .scale = options.loss_scale}) {
  SelectAfresh();
}

SolverRound WorkingPoint::Round(const Eigen::MatrixXd& basis) const {
  return {.rig = rig_,
          .reference = reference_,
          .problem = problem_,
          .motions = selection_.motions(),
          .whitening = selection_.whitening(),
          .basis = basis,
          .loss = screening().loss,
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
                             selection_.motions(),
                             screening().landmarks);
}

double WorkingPoint::UnweightedCost() {
  const Eigen::MatrixXd basis = TangentBasis(rig_, subspace());
  SetTrackNoise(1, &selection_.screening());
  return RoundCost(Round(basis), estimate_, screening().landmarks);
}

double WorkingPoint::StepSigmas() const {
  const SharedInformation& about = information();
  return LargestInSigmas(
      SubspaceStep(rig_, subspace(), about.Lambda, about.eta), covariance_);
}

// All residuals are large at a start far from the optimum, so that
// observability is assessed without their robust weights. As weights can only
// reduce information, this is unnecessary if everything is observed with them.
bool WorkingPoint::FindSubspace() {
  if (!Linearise()) return false;
  if (ChooseSubspace()) return true;
  directions_.Set(WholeSubspace(rig_));
  estimate_.d = start_d_;
  if (!LineariseBy(nullptr)) return false;
  ChooseSubspace();
  return Linearise();
}

void WorkingPoint::Select() { SelectAtEstimate(/*afresh=*/false); }

void WorkingPoint::SelectAfresh() { SelectAtEstimate(/*afresh=*/true); }

void WorkingPoint::SelectAtEstimate(bool afresh) {
  selection_.Select(rig_, theta(), problem_, estimate_.keyframes, afresh);
}

bool WorkingPoint::Linearise() { return LineariseBy(&screening().loss); }

bool WorkingPoint::LineariseBy(const RobustLoss* loss) {
  const Eigen::MatrixXd basis = TangentBasis(rig_, subspace());
  if (!LineariseRound(
          Round(basis), estimate_, screening().landmarks, loss, &linearised_)) {
    return false;
  }
  covariance_ = SubspaceCovariance(rig_, subspace(), information().Lambda);
  return covariance_.allFinite();
}

bool WorkingPoint::ChooseSubspace() {
  ThetaSubspace observed = directions_.Choose(rig_, information().Lambda);
  const bool same = observed.held.cols() == subspace().held.cols();
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
  directions_.Set(std::move(subspace));
  const ThetaSubspace& chosen = directions_.subspace();
  estimate_.d =
      start_d_ + ProjectOnSubspace(rig_, chosen, estimate_.d - start_d_);
  covariance_ = SubspaceCovariance(rig_, chosen, information().Lambda);
}

bool WorkingPoint::HoldAssessed(ThetaSubspace subspace) {
  Hold(std::move(subspace));
  directions_.SetAssessed();
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
  selection_.SetLossScale(options_.loss_scale * residuals);
  directions_.SetReweighted();
  WeightByTracks(1);
}

void WorkingPoint::WeightByTracks(double track_noise_factor) {
  selection_.SetTrackNoiseFactor(track_noise_factor);
}

StepOutcome WorkingPoint::Step() {
  const Eigen::MatrixXd basis = TangentBasis(rig_, subspace());
  return TakeStep(
      Round(basis), linearised_, &estimate_, &selection_.screening().landmarks);
}

SolverOutcome WorkingPoint::SolveRound(int max_iterations,
                                       double tolerance,
                                       const SolverCallback& callback) {
  const Eigen::MatrixXd basis = TangentBasis(rig_, subspace());
  SolverRound round = Round(basis);
  round.max_iterations = max_iterations;
  round.function_tolerance = tolerance;
  return selfcal::SolveRound(options_.solver,
                             round,
                             callback,
                             &estimate_,
                             &selection_.screening().landmarks);
}

}  // namespace selfcal
