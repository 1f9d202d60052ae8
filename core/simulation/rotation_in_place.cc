// Rotation about a pivot c(t) that is nearly at rest:
//   q(t) = Exp(yaw(t) e_z) Exp(phi(t)),  p(t) = c(t) - R(t) r,
// with the pivot r in the frame of the body, and by the chain rule
//   w = J_r(phi) phi' + R_phi^T yaw' e_z,
//   v = c' - R (w x r),
//   a = c'' - R (w x (w x r) + w' x r).
#include <array>
#include <cmath>

#include "core/model/so3.h"
#include "core/simulation/random.h"
#include "core/simulation/rotation_rates.h"
#include "core/simulation/sine_sum.h"
#include "core/simulation/trajectory.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kRotationStream = 3;
constexpr std::uint64_t kPivotStream = 4;

struct PivotWaves {
  SineSum phi, yaw, pivot;
};

PivotWaves DrawPivotWaves(const RotationInPlaceOptions& options,
                          std::uint64_t seed) {
  Random random(seed, kRotationStream);
  PivotWaves waves;
  // Slow rotations of the whole body about the vertical.
  waves.yaw.Add(
      0.03,
      0.08,
      [&](int, double) { return options.excitation * 1.2; },
      &random);
  struct Band {
    double low_hz, high_hz, rate_radps;
  };
  for (const Band& band : {Band{0.25, 0.5, 0.5},
                           Band{0.5, 0.9, 0.8},
                           Band{0.9, 1.4, 0.6},
                           Band{1.4, 2.0, 0.25}}) {
    waves.phi.Add(
        band.low_hz,
        band.high_hz,
        [&](int, double omega) {
          return options.excitation * band.rate_radps / omega;
        },
        &random);
  }
  Random pivot(seed, kPivotStream);
  constexpr std::array<std::array<double, 2>, 3> kBands_hz = {
      {{0.3, 0.6}, {0.6, 1.2}, {1.2, 2.0}}};
  for (const auto& [low_hz, high_hz] : kBands_hz) {
    // Three sines of this amplitude have the requested standard deviation.
    waves.pivot.Add(
        low_hz,
        high_hz,
        [&](int, double) {
          return options.pivot_jitter_m * std::sqrt(2.0 / 3);
        },
        &pivot);
  }
  return waves;
}

class RotationInPlace final : public Trajectory {
 public:
  RotationInPlace(double duration_s,
                  const RotationInPlaceOptions& options,
                  std::uint64_t seed)
      : duration_s_(duration_s),
        r_I_(options.pivot_I),
        waves_(DrawPivotWaves(options, seed)) {}

  double duration_s() const override { return duration_s_; }

  BodyMotion At(double t_s) const override {
    const Curve phi = waves_.phi.At(t_s);
    const Curve yaw = waves_.yaw.At(t_s);
    const Curve pivot = waves_.pivot.At(t_s);
    const Eigen::Quaterniond q_phi = Exp(phi.x);
    const RotationRates rates = RatesOf(phi);
    const Eigen::Vector3d yaw_w =
        q_phi.conjugate() * Eigen::Vector3d(0, 0, yaw.d1[0]);
    const Eigen::Vector3d yaw_dw =
        q_phi.conjugate() * Eigen::Vector3d(0, 0, yaw.d2[0]) -
        rates.w.cross(yaw_w);
    const Eigen::Vector3d dw = rates.dw + yaw_dw;
    BodyMotion motion;
    motion.w_I = rates.w + yaw_w;
    motion.dw_I = dw;
    motion.q_GI = Exp({0, 0, yaw.x[0]}) * q_phi;
    const Eigen::Vector3d around = motion.w_I.cross(r_I_);
    const Eigen::Vector3d pivot_G =
        pivot.x.matrix() + Eigen::Vector3d(0, 0, 1.5);
    motion.p_GI = pivot_G - motion.q_GI * r_I_;
    motion.v_GI = pivot.d1.matrix() - motion.q_GI * around;
    motion.a_GI = pivot.d2.matrix() -
                  motion.q_GI * (motion.w_I.cross(around) + dw.cross(r_I_));
    return motion;
  }

 private:
  const double duration_s_;
  const Eigen::Vector3d r_I_;
  const PivotWaves waves_;
};

}  // namespace

std::unique_ptr<Trajectory> MakeRotationInPlace(
    double duration_s,
    const RotationInPlaceOptions& options,
    std::uint64_t seed) {
  return std::make_unique<RotationInPlace>(duration_s, options, seed);
}

}  // namespace selfcal
