#include "core/calibration/absent_effects.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iterator>

#include "core/change/chi_square.h"
#include "core/information/segment_scorer.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

constexpr const char* kEffects[] = {"imu.gyro.g_sensitivity",
                                    "imu.accel.position",
                                    "*.time_offset",
                                    "*.line_delay"};

// The square of a normal variable that chance exceeds once in 10,000 times.
constexpr double kCertainSquare = 15.1;

// The rig, or a calibration of it, with all effects.
struct Extended {
  Rig rig;
  Calibration theta;
};

Extended WithEffects(const Rig& rig, const Calibration& theta) {
  Extended all{rig, theta};
  all.rig.prior_mean.reset();  // it lacks the effects
  if (theta.imu.accel_position.size() == 0) {
    // The axes relative to that of x, which defines the origin.
    all.rig.factory.imu.accel_position.setZero(9);
    all.theta.imu.accel_position.setZero(9);
    all.rig.fixed.emplace_back("imu.accel.position.x.*");
  }
  for (const char* effect : kEffects) all.rig.blocks.push_back({effect, true});
  AddEstimatedBlocks(all.rig.blocks, &all.rig.factory);
  AddEstimatedBlocks(all.rig.blocks, &all.theta);
  all.rig.groups.clear();
  return all;
}

// Sum over segments that share nothing, about theta, in units of the prior's
// sigmas.
OffsetInformation InformationOf(const Extended& all,
                                const KnownCalibration& calibration,
                                const std::vector<MotionSegment>& segments) {
  const auto size = static_cast<Eigen::Index>(TangentSize(all.theta));
  const ConsistencyTester tester(all.rig,
                                 {all.theta,
                                  Eigen::MatrixXd::Zero(size, size),
                                  calibration.track_noise_factor});
  const auto free = static_cast<Eigen::Index>(FreeComponents(all.rig).size());
  OffsetInformation sum{Eigen::MatrixXd::Zero(free, free),
                        Eigen::VectorXd::Zero(free)};
  SegmentScorer scorer;
  SegmentInformation information;
  for (const MotionSegment& segment : segments) {
    scorer.Score(all.rig, all.theta, segment, {}, &information);
    if (tester.Accepts(information)) sum += tester.Offset(information);
  }
  return sum;
}

class EffectTests {
 public:
  EffectTests(const Rig& rig,
              const KnownCalibration& calibration,
              const Eigen::MatrixXd& covariance_of_data,
              const Extended& all,
              const std::vector<MotionSegment>& segments)
      : names_(TangentComponents(all.rig.factory)),
        free_(FreeComponents(all.rig)),
        sum_(InformationOf(all, calibration, segments)) {
    const auto known = TangentComponents(rig.factory);
    for (const int k : FreeComponents(rig)) {
      const auto at = std::find_if(free_.begin(), free_.end(), [&](int i) {
        return names_[i].name == known[k].name;
      });
      theta_.push_back(static_cast<int>(at - free_.begin()));
    }
    const std::vector<int> free = FreeComponents(rig);
    const Eigen::VectorXd scale =
        Eigen::VectorXd(PriorSigmas(rig)(free)).cwiseInverse();
    of_data_ = scale.asDiagonal() * covariance_of_data(free, free) *
               scale.asDiagonal();
    sigmas_ = scale.cwiseProduct(
        Eigen::VectorXd(calibration.covariance.diagonal())(free).cwiseSqrt());
  }

  // Nothing if no component of the block is an effect that is not estimated.
  std::vector<AbsentEffect> Test(const std::string& pattern) const {
    std::vector<AbsentEffect> tested;
    std::vector<std::string> blocks;
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const TangentComponent& component = names_[free_[i]];
      if (MatchComponents({component}, {pattern, pattern + ".*"}).empty() ||
          IsKnown(static_cast<int>(i))) {
        continue;
      }
      const std::string block = BlockOf(component.name, pattern);
      if (blocks.empty() || blocks.back() != block) blocks.push_back(block);
    }
    for (const std::string& block : blocks) tested.push_back(TestBlock(block));
    return tested;
  }

 private:
  bool IsKnown(int i) const {
    return std::find(theta_.begin(), theta_.end(), i) != theta_.end();
  }

  // "imu.accel.position" of "imu.accel.position.y.x".
  static std::string BlockOf(const std::string& component,
                             const std::string& pattern) {
    return pattern.front() == '*' ? component : pattern;
  }

  std::vector<int> ComponentsOf(const std::string& block) const {
    std::vector<int> at;
    for (std::size_t i = 0; i < free_.size(); ++i) {
      if (!MatchComponents({names_[free_[i]]}, {block, block + ".*"}).empty()) {
        at.push_back(static_cast<int>(i));
      }
    }
    return at;
  }

  AbsentEffect TestBlock(const std::string& block) const {
    const std::vector<int> at = ComponentsOf(block);
    Eigen::MatrixXd of_theta = sum_.Lambda(theta_, theta_);
    of_theta.diagonal().array() += 1;  // the prior
    const Eigen::LLT<Eigen::MatrixXd> eliminate(of_theta);
    const Eigen::MatrixXd coupling = sum_.Lambda(theta_, at);
    const Eigen::MatrixXd S =
        sum_.Lambda(at, at) - coupling.transpose() * eliminate.solve(coupling);
    const Eigen::VectorXd eta =
        sum_.eta(at) - coupling.transpose() * eliminate.solve(sum_.eta(theta_));
    const SymmetricEigen eigen(S);
    const Eigen::MatrixXd step = of_data_ * coupling;  // of theta, by B
    Eigen::VectorXd shift = Eigen::VectorXd::Zero(theta_.size());
    Eigen::VectorXd variance = Eigen::VectorXd::Zero(theta_.size());
    bool certain = false;
    AbsentEffect effect{block, {}, 0, ""};
    for (Eigen::Index j = 0; j < eta.size(); ++j) {
      const double information = eigen.eigenvalues()(j);
      if (!(information >= kObserved)) continue;
      const Eigen::VectorXd u = eigen.eigenvectors().col(j);
      const double square = std::pow(u.dot(eta), 2) / information;
      effect.test.statistic += square;
      ++effect.test.degrees;
      certain = certain || square > kCertainSquare;
      const Eigen::VectorXd along = step * u;
      shift += along * u.dot(eta) / information;
      variance += along.cwiseAbs2() / information;
    }
    if (effect.test.degrees == 0) return effect;
    effect.test.probability =
        ChiSquareTail(effect.test.statistic, effect.test.degrees);
    if (!certain) return effect;
    for (Eigen::Index k = 0; k < shift.size(); ++k) {
      const double sigmas =
          std::sqrt(shift(k) * shift(k) + variance(k)) / sigmas_(k);
      if (sigmas <= effect.bias_sigmas) continue;
      effect.bias_sigmas = sigmas;
      effect.component = names_[free_[theta_[k]]].name;
    }
    return effect;
  }

  const std::vector<TangentComponent> names_;
  const std::vector<int> free_;  // with all effects
  const OffsetInformation sum_;  // of the free components
  std::vector<int> theta_;       // what the rig estimates, in the free ones
  // The covariance of these by the data alone, and their sigmas in the
  // calibration, in units of the prior's sigmas.
  Eigen::MatrixXd of_data_;
  Eigen::VectorXd sigmas_;
};

}  // namespace

std::vector<AbsentEffect> TestAbsentEffects(
    const Rig& rig,
    const KnownCalibration& calibration,
    const Eigen::MatrixXd& covariance_of_data,
    const std::vector<MotionSegment>& segments) {
  std::vector<AbsentEffect> effects;
  if (segments.empty()) return effects;
  const EffectTests tests(rig,
                          calibration,
                          covariance_of_data,
                          WithEffects(rig, calibration.theta),
                          segments);
  for (const char* effect : kEffects) {
    const std::vector<AbsentEffect> some = tests.Test(effect);
    effects.insert(effects.end(), some.begin(), some.end());
  }
  return effects;
}

}  // namespace selfcal
