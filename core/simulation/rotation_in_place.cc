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
#include "core/simulation/sine_sum.h"
#include "core/simulation/trajectory.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kRotationStream = 3;
constexpr std::uint64_t kPivotStream = 4;

// Derivatives, with respect to the square of the angle, of b and c in
//   J_r(phi) = I - b [phi]x + c [phi]x^2,
//   b = (1 - cos t) / t^2, c = (t - sin t) / t^3, t = |phi|:
// b' = (db/dt) / t (phi . phi'), c' likewise.
struct JacobianTerms {
  double b, c;
  double b_slope, c_slope;  // (db/dt) / t, (dc/dt) / t
};

JacobianTerms TermsOf(double t) {
  const double t2 = t * t;
  if (t < 1e-2) {
    // Taylor series; the next terms are below 1e-12.
    return {0.5 - t2 / 24 + t2 * t2 / 720,
            1.0 / 6 - t2 / 120 + t2 * t2 / 5040,
            -1.0 / 12 + t2 / 180 - t2 * t2 / 6720,
            -1.0 / 60 + t2 / 1260 - t2 * t2 / 60480};
  }
  const double s = std::sin(t);
  const double v = 1 - std::cos(t);
  return {v / t2,
          (t - s) / (t2 * t),
          (t * s - 2 * v) / (t2 * t2),
          (t * v - 3 * (t - s)) / (t2 * t2 * t)};
}

// Angular rate and acceleration in the frame of the body.
struct Rates {
  Eigen::Vector3d w, dw;
};

// Rates of Exp(phi(t)).
Rates RatesOf(const Curve& phi) {
  const Eigen::Vector3d x = phi.x;
  const Eigen::Vector3d d1 = phi.d1;
  const Eigen::Vector3d d2 = phi.d2;
  const JacobianTerms j = TermsOf(x.norm());
  const double slope = x.dot(d1);
  const Eigen::Vector3d first = x.cross(d1);
  const Eigen::Vector3d second = x.cross(first);
  const Eigen::Vector3d first_d = x.cross(d2);
  const Eigen::Vector3d second_d = d1.cross(first) + x.cross(first_d);
  return {d1 - j.b * first + j.c * second,
          d2 - j.b_slope * slope * first - j.b * first_d +
              j.c_slope * slope * second + j.c * second_d};
}

struct Waves {
  SineSum phi, yaw, pivot;
};

Waves DrawWaves(const RotationInPlaceOptions& options, std::uint64_t seed) {
  Random random(seed, kRotationStream);
  Waves waves;
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
        waves_(DrawWaves(options, seed)) {}

  double duration_s() const override { return duration_s_; }

  BodyMotion At(double t_s) const override {
    const Curve phi = waves_.phi.At(t_s);
    const Curve yaw = waves_.yaw.At(t_s);
    const Curve pivot = waves_.pivot.At(t_s);
    const Eigen::Quaterniond q_phi = Exp(phi.x);
    const Rates rates = RatesOf(phi);
    const Eigen::Vector3d yaw_w =
        q_phi.conjugate() * Eigen::Vector3d(0, 0, yaw.d1[0]);
    const Eigen::Vector3d yaw_dw =
        q_phi.conjugate() * Eigen::Vector3d(0, 0, yaw.d2[0]) -
        rates.w.cross(yaw_w);
    const Eigen::Vector3d dw = rates.dw + yaw_dw;
    BodyMotion motion;
    motion.w_I = rates.w + yaw_w;
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
  const Waves waves_;
};

}  // namespace

std::unique_ptr<Trajectory> MakeRotationInPlace(
    double duration_s,
    const RotationInPlaceOptions& options,
    std::uint64_t seed) {
  return std::make_unique<RotationInPlace>(duration_s, options, seed);
}

}  // namespace selfcal
