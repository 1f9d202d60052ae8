#include "test/evaluation/dominated_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "core/model/so3.h"
#include "core/simulation/random.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kMotionStream = 101;
constexpr std::uint64_t kKindStream = 102;
constexpr double kStretch_s = 4;
constexpr double kPoseRate_hz = 50;

// How strongly the body turns about its axes and moves along them; 1 is as
// vigorous as MakeHandheld(1).
struct Strength {
  Eigen::Array3d turn = Eigen::Array3d::Constant(0.03);
  Eigen::Array3d move = Eigen::Array3d::Constant(0.03);
};

Strength Dominant(DominantMotion dominant) {
  Strength strength;
  switch (dominant) {
    case DominantMotion::kOneAxis:
      strength.turn.z() = 1;
      strength.move = {1, 1, 0.03};
      break;
    case DominantMotion::kCalm:
      break;
    case DominantMotion::kRotationOnly:
      strength.turn.setConstant(0.7);
      break;
  }
  return strength;
}

// One of the ways in which it rarely moves; `kind` counts them.
Strength Rare(DominantMotion dominant, std::size_t kind) {
  const auto axis = static_cast<Eigen::Index>(kind % 3);
  Strength strength;
  switch (dominant) {
    case DominantMotion::kOneAxis:
      strength.turn.head<2>().setConstant(0.4);
      strength.move.z() = 0.4;
      break;
    case DominantMotion::kCalm:
      (kind < 3 ? strength.turn : strength.move)[axis] = 0.8;
      break;
    case DominantMotion::kRotationOnly:
      strength.turn[axis] = 0.1;
      strength.move.setConstant(0.5);
      break;
  }
  return strength;
}

// Sums of sines on three axes.
class Waves {
 public:
  // Each axis and band with the given peak at derivative `order`.
  Waves(double low_hz, double high_hz, double peak, int order, Random* random) {
    for (int band = 0; band < 3; ++band) {
      for (int axis = 0; axis < 3; ++axis) {
        const double omega = 2 * std::numbers::pi *
                             random->Uniform(low_hz, high_hz) * (1 + band);
        terms_.push_back({axis,
                          peak / 3 / std::pow(omega, order),
                          omega,
                          random->Uniform(0, 2 * std::numbers::pi)});
      }
    }
  }
  Eigen::Array3d At(double t_s) const {
    Eigen::Array3d sum = Eigen::Array3d::Zero();
    for (const Term& term : terms_) {
      sum[term.axis] +=
          term.amplitude * std::sin(term.omega * t_s + term.phase);
    }
    return sum;
  }

 private:
  struct Term {
    int axis;
    double amplitude, omega, phase;
  };
  std::vector<Term> terms_;
};

// The strength of each stretch, and smoothly from one to the next.
class Strengths {
 public:
  Strengths(DominantMotion dominant,
            double rare_part,
            double duration_s,
            std::uint64_t seed) {
    Random random(seed, kKindStream);
    for (double t = 0; t <= duration_s + kStretch_s; t += kStretch_s) {
      const bool rare = random.Chance(rare_part);
      const std::size_t kind = random.Index(6);
      stretches_.push_back(rare ? Rare(dominant, kind) : Dominant(dominant));
    }
  }
  Strength At(double t_s) const {
    constexpr double kChange_s = 0.5;
    const auto at = static_cast<std::size_t>(t_s / kStretch_s);
    const double since_s = t_s - static_cast<double>(at) * kStretch_s;
    const Strength& now = stretches_[at];
    if (at == 0 || since_s >= kChange_s) return now;
    const double x = since_s / kChange_s;
    const double part = x * x * x * (10 - 15 * x + 6 * x * x);
    const Strength& before = stretches_[at - 1];
    return {before.turn + part * (now.turn - before.turn),
            before.move + part * (now.move - before.move)};
  }

 private:
  std::vector<Strength> stretches_;
};

}  // namespace

std::string NameOf(DominantMotion dominant) {
  switch (dominant) {
    case DominantMotion::kOneAxis:
      return "one axis";
    case DominantMotion::kCalm:
      return "calm";
    case DominantMotion::kRotationOnly:
      break;
  }
  return "rotation only";
}

std::unique_ptr<Trajectory> MakeDominated(DominantMotion dominant,
                                          double rare_part,
                                          double duration_s,
                                          std::uint64_t seed) {
  Random random(seed, kMotionStream);
  const Waves walk(0.01, 0.02, 1, 0, &random);  // [m]
  const Waves turn(0.3, 0.6, 2, 1, &random);    // [rad/s]
  const Waves move(0.3, 0.6, 5, 2, &random);    // [m/s^2]
  const Strengths strengths(dominant, rare_part, duration_s, seed);
  std::vector<TimedPose> poses;
  for (int i = 0; i <= duration_s * kPoseRate_hz; ++i) {
    const double t_s = i / kPoseRate_hz;
    const Strength strength = strengths.At(t_s);
    const Eigen::Array3d slow = walk.At(t_s);
    const Eigen::Array3d angles = strength.turn * turn.At(t_s);
    TimedPose pose;
    pose.t_s = t_s;
    pose.q_GI =
        Exp({0, 0, slow.z() + angles.z()}) * Exp({angles.x(), angles.y(), 0});
    pose.p_GI = Eigen::Vector3d(slow.x(), slow.y(), 1.5) +
                (strength.move * move.At(t_s)).matrix();
    poses.push_back(pose);
  }
  std::string error;
  std::unique_ptr<Trajectory> trajectory = MakeSpline(poses, {}, &error);
  if (!trajectory) throw std::runtime_error(error);
  return trajectory;
}

}  // namespace selfcal
