#include "core/calibration/linear_motion.h"

#include "core/information/linearisation.h"
#include "core/information/weak_priors.h"
#include "core/model/second_imu.h"

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

ChainStateMatrix WeakPrior(int size) {
  ChainStateMatrix weak = MotionPrior(size);
  weak.diagonal().segment<3>(kStateRotation).array() =
      Information(kTiltPriorSigma_rad);
  return weak;
}

// Steps within which factors are approximately linear.
ChainStateMatrix SmallSteps(int size) {
  ChainStateMatrix small = ChainStateMatrix::Zero(size, size);
  small.diagonal().segment<3>(kStateRotation).array() =
      Information(kSmallTilt_rad);
  for (int motion = 0; motion + kStateTangentSize <= size;
       motion += kMotionTangentSize) {
    const auto set = [&](int at, double sigma) {
      small.diagonal().segment<3>(motion + at).array() = Information(sigma);
    };
    set(kStateVelocity, kSmallVelocity_mps);
    set(kStateAccelBias, kSmallAccelBias_mps2);
    set(kStateGyroBias, kSmallGyroBias_radps);
  }
  return small;
}

// Information about position and rotation about gravity.
ChainStateMatrix GaugePriorOf(const KeyframeState& x, int size) {
  ChainStateMatrix gauge = ChainStateMatrix::Zero(size, size);
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
  links_ = static_cast<int>(links.size());
  places_.assign(point.keyframes.size(), {});
  transitions_.resize(point.thetas.size());
  for (int t = 0; t < point.thetas.size(); ++t) {
    for (int imu = 0; imu < kMaxImus; ++imu) {
      states_[imu].clear();
      roots_[imu].clear();
    }
    for (std::size_t i = 0; i < links.size(); ++i) {
      const InertialLink& link = links[i];
      if (point.thetas.IndexOf(link.before) != t) continue;
      // The links of each IMU are in the same order.
      std::vector<InertialLinkStates>& states = states_[link.imu];
      Place& place = places_[link.before];
      place.theta = t;
      place.index = static_cast<int>(states.size());
      place.links[link.imu] = static_cast<int>(i);
      states.push_back({&point.keyframes[link.before],
                        &point.keyframes[link.after],
                        link.samples});
      roots_[link.imu].push_back(roots[i]);
    }
    inertial_.LineariseWithRoots(states_,
                                 point.thetas[t],
                                 point.rig.gravity_mps2,
                                 roots_,
                                 &transitions_[t]);
  }
}

double LinearMotion::Squares() const {
  double squares = 0;
  for (const Place& place : places_) {
    if (place.index < 0) continue;
    const LinkTransitions& transitions = transitions_[place.theta];
    for (int imu = 0; imu < transitions.imus(); ++imu) {
      for (const double r : transitions.Whitened(place.index, imu)) {
        squares += r * r;
      }
    }
  }
  return squares;
}

void LinearMotion::AddPosterior(int keyframe,
                                const ChainNoiseVector& noise,
                                const ChainNoiseMatrix& covariance,
                                LinearPosterior* posterior) const {
  const Place& place = places_[keyframe];
  const LinkTransitions& transitions = transitions_[place.theta];
  const ChainNoiseVector of_imus = transitions.NoiseOfImus(place.index, noise);
  const ChainNoiseMatrix covariance_of_imus =
      transitions.CovarianceOfImus(place.index, covariance);
  for (int imu = 0; imu < transitions.imus(); ++imu) {
    const int at = imu * kChainStateSize;
    const int link = place.links[imu];
    posterior->inertial[link] = of_imus.segment<kChainStateSize>(at);
    posterior->inertial_covariance[link] =
        covariance_of_imus.block<kChainStateSize, kChainStateSize>(at, at);
  }
}

void KeyframePriors::Set(const LinearPoint& point, double damping) {
  const int size = StateTangentSize(point.rig.factory);
  information_.assign(point.keyframes.size(),
                      ChainStateMatrix::Zero(size, size));
  present_.assign(point.keyframes.size(), false);
  for (const int k : point.problem.chain_starts) {
    information_[k] += WeakPrior(size) + damping * SmallSteps(size);
    present_[k] = true;
  }
  for (const int k : point.problem.gauge_keyframes) {
    information_[k] += GaugePriorOf(point.keyframes[k], size);
    present_[k] = true;
  }
}

}  // namespace selfcal
