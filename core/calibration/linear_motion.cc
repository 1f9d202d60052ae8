#include "core/calibration/linear_motion.h"

#include "core/information/weak_priors.h"

namespace selfcal {
namespace {

// The gauge consists of four free directions, so that a prior of any strength
// on them changes nothing else. This one is of the size of the other terms, yet
// so strong that the landmarks' priors, which are about fixed positions, do not
// move them.
constexpr double kGaugeSigma_m = 1e-5;
constexpr double kGaugeSigma_rad = 1e-5;

constexpr double kSmallTilt_rad = 0.1;
constexpr double kSmallVelocity_mps = 0.3;
constexpr double kSmallAccelBias_mps2 = 1;
constexpr double kSmallGyroBias_radps = 0.1;

double Information(double sigma) { return 1 / (sigma * sigma); }

ChainStateMatrix WeakPrior() {
  ChainStateMatrix weak = ChainStateMatrix::Zero();
  weak.diagonal().segment<3>(kStateRotation).array() =
      Information(kTiltPriorSigma_rad);
  weak.diagonal().segment<3>(kStateVelocity).array() =
      Information(kVelocityPriorSigma_mps);
  weak.diagonal().segment<3>(kStateAccelBias).array() =
      Information(kAccelBiasPriorSigma_mps2);
  weak.diagonal().segment<3>(kStateGyroBias).array() =
      Information(kGyroBiasPriorSigma_radps);
  return weak;
}

// Steps within which factors are approximately linear.
ChainStateMatrix SmallSteps() {
  ChainStateMatrix small = ChainStateMatrix::Zero();
  small.diagonal().segment<3>(kStateRotation).array() =
      Information(kSmallTilt_rad);
  small.diagonal().segment<3>(kStateVelocity).array() =
      Information(kSmallVelocity_mps);
  small.diagonal().segment<3>(kStateAccelBias).array() =
      Information(kSmallAccelBias_mps2);
  small.diagonal().segment<3>(kStateGyroBias).array() =
      Information(kSmallGyroBias_radps);
  return small;
}

// Information about position and rotation about gravity.
ChainStateMatrix GaugePrior(const KeyframeState& x) {
  ChainStateMatrix gauge = ChainStateMatrix::Zero();
  const Eigen::Vector3d up_I = x.q_GI.conjugate() * Eigen::Vector3d::UnitZ();
  gauge.block<3, 3>(kStateRotation, kStateRotation) =
      Information(kGaugeSigma_rad) * up_I * up_I.transpose();
  gauge.diagonal().segment<3>(kStatePosition).array() =
      Information(kGaugeSigma_m);
  return gauge;
}

}  // namespace

void LinearMotion::Linearise(const LinearPoint& point,
                             std::span<const InertialNoiseRoot> roots) {
  const std::vector<InertialLink>& links = point.problem.inertial_links;
  link_after_.assign(point.keyframes.size(), -1);
  places_.resize(links.size());
  transitions_.resize(point.thetas.size());
  for (int t = 0; t < point.thetas.size(); ++t) {
    states_.clear();
    roots_.clear();
    for (std::size_t i = 0; i < links.size(); ++i) {
      if (point.thetas.IndexOf(links[i].before) != t) continue;
      places_[i] = {t, static_cast<int>(states_.size())};
      states_.push_back({&point.keyframes[links[i].before],
                         &point.keyframes[links[i].after],
                         links[i].samples});
      roots_.push_back(roots[i]);
      link_after_[links[i].before] = static_cast<int>(i);
    }
    inertial_.LineariseWithRoots(states_,
                                 point.thetas[t].imu,
                                 point.rig.gravity_mps2,
                                 roots_,
                                 &transitions_[t]);
  }
}

double LinearMotion::Squares() const {
  double squares = 0;
  for (int i = 0; i < links(); ++i) {
    const std::span whitened(transition(i).whitened, kChainStateSize);
    for (const double r : whitened) squares += r * r;
  }
  return squares;
}

void KeyframePriors::Set(const LinearPoint& point, double damping) {
  information_.assign(point.keyframes.size(), ChainStateMatrix::Zero());
  present_.assign(point.keyframes.size(), false);
  for (const int k : point.problem.chain_starts) {
    information_[k] += WeakPrior() + damping * SmallSteps();
    present_[k] = true;
  }
  for (const int k : point.problem.gauge_keyframes) {
    information_[k] += GaugePrior(point.keyframes[k]);
    present_[k] = true;
  }
}

}  // namespace selfcal
