// The effect of the walk of the biases within an interval on its motion,
// compared with the response of the motion to a step of each bias at each
// sample.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "core/factor/inertial.h"
#include "core/factor/preintegration.h"
#include "core/model/so3.h"
#include "test/core/factor/analytic_motion.h"
#include "test/core/factor/random_values.h"

namespace selfcal {
namespace {

using Eigen::Vector3d;
using Vector9d = Eigen::Matrix<double, 9, 1>;

// (motion 9, walk of the biases by the end 6).
using WalkCovariance = Eigen::Matrix<double, 15, 15>;

struct Interval {
  AnalyticMotion motion;
  ImuCalibration imu;
  ImuNoise noise;
  std::int64_t end_ns;
  std::vector<ImuSample> samples;

  Interval(RandomValues& random, double rate_hz, double duration_s)
      : motion(random),
        imu(random.Imu()),
        end_ns(std::llround(1e9 * duration_s)) {
    const auto period_ns = std::llround(1e9 / rate_hz);
    samples = motion.Readings(-period_ns / 3,
                              end_ns + period_ns,
                              period_ns,
                              imu,
                              Vector3d::Zero(),
                              Vector3d::Zero(),
                              9.81);
  }

  Preintegration Integrate(std::span<const ImuSample> readings,
                           bool covariance) const {
    return Preintegrate(readings,
                        0,
                        end_ns,
                        imu,
                        Vector3d::Zero(),
                        Vector3d::Zero(),
                        noise,
                        {.jacobians = false, .covariance = covariance});
  }

  WalkCovariance Propagated() const {
    const Preintegration result = Integrate(samples, true);
    const Eigen::Matrix<double, 6, 1> walk =
        BiasWalkSigmas(noise, result.dt_s).cwiseAbs2();
    WalkCovariance covariance;
    covariance << result.covariance, result.covariance_with_walk,
        result.covariance_with_walk.transpose(),
        Eigen::MatrixXd(walk.asDiagonal());
    return covariance;
  }

  // Errors due to a small step of a bias from sample `first` on, relative to
  // the step.
  Vector9d StepResponse(std::size_t first, int axis) const {
    constexpr double kStep = 1e-4;
    const auto integrate = [&](double step) {
      std::vector<ImuSample> moved = samples;
      for (std::size_t i = first; i < moved.size(); ++i) {
        (axis < 3 ? moved[i].accel : moved[i].gyro)[axis % 3] += step;
      }
      return Integrate(moved, false);
    };
    const Preintegration a = integrate(-kStep), b = integrate(kStep);
    Vector9d difference;
    difference << Log(a.Delta_R.conjugate() * b.Delta_R), b.Delta_v - a.Delta_v,
        b.Delta_p - a.Delta_p;
    return difference / (2 * kStep);
  }

  // The walk as a sum of independent steps, one at each sample.
  WalkCovariance OfSteps() const {
    const Eigen::Matrix<double, 6, 1> densities =
        BiasWalkSigmas(noise, 1).cwiseAbs2();
    WalkCovariance sum = WalkCovariance::Zero();
    double t_s = 0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (samples[i].t_ns <= 0 || samples[i].t_ns >= end_ns) continue;
      const bool last =
          i + 1 == samples.size() || samples[i + 1].t_ns >= end_ns;
      const double end_s =
          1e-9 *
          static_cast<double>(
              last ? end_ns : (samples[i].t_ns + samples[i + 1].t_ns) / 2);
      for (int axis = 0; axis < 6; ++axis) {
        Eigen::Matrix<double, 15, 1> response =
            Eigen::Matrix<double, 15, 1>::Unit(9 + axis);
        response.head<9>() = StepResponse(i, axis);
        sum +=
            densities[axis] * (end_s - t_s) * response * response.transpose();
      }
      t_s = end_s;
    }
    return sum;
  }
};

// Intervals that rotate by several radians within a second: the longer ones are
// far from a constant rotation.
TEST(BiasWalk, MovesTheMotionAsStepsOfTheBiasesDo) {
  RandomValues random(1);
  for (const double rate_hz : {100.0, 200.0, 500.0}) {
    for (const double duration_s : {0.1, 0.5, 1.0, 3.0}) {
      if (rate_hz * duration_s > 700) continue;
      SCOPED_TRACE(std::to_string(rate_hz) + " Hz, " +
                   std::to_string(duration_s) + " s");
      Interval interval(random, rate_hz, duration_s);
      const WalkCovariance all = interval.Propagated();
      Interval still = interval;
      still.noise.gyro_bias_random_walk = 0;
      still.noise.accel_bias_random_walk = 0;
      // In standard deviations of all noise: where white noise dominates, the
      // walk does not matter.
      const Eigen::LLT<WalkCovariance> llt(all);
      const auto whitened = [&](const WalkCovariance& of) -> WalkCovariance {
        const WalkCovariance half = llt.matrixL().solve(of);
        return llt.matrixL().solve(half.transpose());
      };
      const WalkCovariance walk = whitened(all - still.Propagated());
      const WalkCovariance steps = whitened(interval.OfSteps());
      std::printf("%g Hz, %g s: walk %.3f, off by %.4f\n",
                  rate_hz,
                  duration_s,
                  walk.topLeftCorner<9, 9>().diagonal().maxCoeff(),
                  (walk - steps).cwiseAbs().maxCoeff());
      EXPECT_LT((walk - steps).cwiseAbs().maxCoeff(), 0.03);
    }
  }
}

}  // namespace
}  // namespace selfcal
