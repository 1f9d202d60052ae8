// Motions made of sines, with exact derivatives.
//
//   p(t)   = p_0 + slow_p(S(t)) + e(t) fast_p(t)
//   phi(t) = slow_phi(S(t)) + e(t) fast_phi(t)
//   q(t)   = Exp(yaw(S(t)) e_z) Exp(phi(t))
// with the envelope e and its integral S: if e is zero, the body is at rest,
// and a calm body also walks more slowly.
#include "core/model/so3.h"
#include "core/simulation/envelope.h"
#include "core/simulation/random.h"
#include "core/simulation/rotation_rates.h"
#include "core/simulation/sine_sum.h"
#include "core/simulation/trajectory.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kMotionStream = 1;
constexpr std::uint64_t kEnvelopeStream = 2;

// slow(S(t)) + e(t) fast(t), by the chain and the product rule.
Curve Combine(const SineSum& slow,
              const SineSum& fast,
              double t_s,
              const Envelope::Sample& e) {
  const Curve s = slow.At(e.integral);
  const Curve f = fast.At(t_s);
  Curve sum;
  sum.x = s.x + e.value * f.x;
  sum.d1 = s.d1 * e.value + e.d1 * f.x + e.value * f.d1;
  sum.d2 = s.d2 * e.value * e.value + s.d1 * e.d1 + e.d2 * f.x +
           2 * e.d1 * f.d1 + e.value * f.d2;
  return sum;
}

struct WalkWaves {
  SineSum slow_p, fast_p;      // [m]
  SineSum slow_phi, fast_phi;  // [rad]
  SineSum slow_yaw;            // [rad], the first axis alone
};

// Amplitudes: the walk stays within (2.2, 1.6, 0.4) m, each fast term is
// specified by its peak acceleration or rate, so that the sum is as vigorous as
// stated whatever frequencies are drawn.
WalkWaves DrawWalkWaves(std::uint64_t seed) {
  Random random(seed, kMotionStream);
  WalkWaves waves;
  const Eigen::Vector3d walk_m(2.2, 1.6, 0.4);
  for (const double share : {0.65, 0.35}) {
    waves.slow_p.Add(
        0.02,
        0.06,
        [&](int axis, double) { return share * walk_m[axis]; },
        &random);
    waves.slow_phi.Add(
        0.03, 0.1, [&](int, double) { return share * 0.3; }, &random);
    waves.slow_yaw.Add(
        0.02, 0.06, [&](int, double) { return share * 2; }, &random);
  }
  struct Band {
    double low_hz, high_hz, accel_mps2, rate_radps;
  };
  for (const Band& band : {Band{0.25, 0.5, 0.7, 0.4},
                           Band{0.5, 0.9, 1.5, 0.8},
                           Band{0.9, 1.4, 2.0, 0.6},
                           Band{1.4, 2.0, 1.5, 0.25}}) {
    waves.fast_p.Add(
        band.low_hz,
        band.high_hz,
        [&](int, double omega) { return band.accel_mps2 / (omega * omega); },
        &random);
    waves.fast_phi.Add(
        band.low_hz,
        band.high_hz,
        [&](int, double omega) { return band.rate_radps / omega; },
        &random);
  }
  return waves;
}

class AnalyticTrajectory : public Trajectory {
 public:
  AnalyticTrajectory(double duration_s, Envelope envelope, std::uint64_t seed)
      : duration_s_(duration_s),
        envelope_(std::move(envelope)),
        waves_(DrawWalkWaves(seed)) {}

  double duration_s() const override { return duration_s_; }

  BodyMotion At(double t_s) const override {
    const Envelope::Sample e = envelope_.At(t_s);
    const Curve p = Combine(waves_.slow_p, waves_.fast_p, t_s, e);
    const Curve phi = Combine(waves_.slow_phi, waves_.fast_phi, t_s, e);
    const Curve yaw = waves_.slow_yaw.At(e.integral);
    const Eigen::Quaterniond q_yaw = Exp({0, 0, yaw.x[0]});
    const Eigen::Quaterniond q_phi = Exp(phi.x);
    const Eigen::Vector3d yaw_rate(0, 0, yaw.d1[0] * e.value);
    const Eigen::Vector3d yaw_second(
        0, 0, yaw.d2[0] * e.value * e.value + yaw.d1[0] * e.d1);
    const RotationRates rates = RatesOf(phi);
    BodyMotion motion;
    motion.q_GI = q_yaw * q_phi;
    motion.p_GI = p.x.matrix() + Eigen::Vector3d(0, 0, 1.5);
    motion.v_GI = p.d1;
    motion.a_GI = p.d2;
    motion.w_I =
        RightJacobian(phi.x) * phi.d1.matrix() + q_phi.conjugate() * yaw_rate;
    motion.dw_I = rates.dw + q_phi.conjugate() * yaw_second -
                  rates.w.cross(q_phi.conjugate() * yaw_rate);
    return motion;
  }

 private:
  double duration_s_;
  Envelope envelope_;
  WalkWaves waves_;
};

}  // namespace

std::unique_ptr<Trajectory> MakeRest(double duration_s) {
  return MakeHandheld(duration_s, 0, 0);
}

std::unique_ptr<Trajectory> MakeHandheld(double duration_s,
                                         double excitation,
                                         std::uint64_t seed) {
  return std::make_unique<AnalyticTrajectory>(
      duration_s, Envelope(excitation), seed);
}

std::unique_ptr<Trajectory> MakeMixed(double duration_s, std::uint64_t seed) {
  constexpr double kTransition_s = 2;
  Random random(seed, kEnvelopeStream);
  Envelope envelope(0);
  envelope.Hold(5);
  for (bool excited = true; envelope.end_s() < duration_s; excited = !excited) {
    envelope.MoveTo(excited ? 1 : 0.05, kTransition_s);
    envelope.Hold(random.Uniform(8, 15) - kTransition_s);
  }
  return std::make_unique<AnalyticTrajectory>(
      duration_s, std::move(envelope), seed);
}

}  // namespace selfcal
