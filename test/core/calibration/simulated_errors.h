// Errors of calibrations on simulated sessions, and what their covariances
// claim of them.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {

// Errors of the estimated components.
struct Errors {
  Eigen::VectorXd error;
  Eigen::MatrixXd covariance;

  double Nees() const { return error.dot(covariance.ldlt().solve(error)); }
  int Within(double sigmas) const {
    return static_cast<int>((error.cwiseAbs().array() <=
                             sigmas * covariance.diagonal().cwiseSqrt().array())
                                .count());
  }
};

struct SessionKind {
  int landmarks_in_view = 60;
  int undetermined = 0;  // directions that the session does not determine
  // If not zero, this much time passes from one of its four segments to the
  // next.
  double apart_s = 0;
  // Temperatures of its four segments [deg C]; empty: they state none.
  std::vector<double> temperatures_c = {};
};

inline std::vector<MotionSegment> SimulateKind(const Rig& rig,
                                               const Calibration& truth,
                                               const SimulationOptions& options,
                                               const SessionKind& kind) {
  if (kind.apart_s > 0) {
    return SimulateApart(rig, truth, 4, kind.apart_s, options);
  }
  if (!kind.temperatures_c.empty()) {
    return SimulateAtTemperatures(rig, truth, kind.temperatures_c, options);
  }
  return Simulate(rig,
                  truth,
                  rig.factory,
                  *MakeHandheld(12.5, 1, options.seed),
                  "s",
                  options)
      .segments;
}

// `rig` has the factory calibration; `truth` is the true one, and `expected`
// the part of it that the rig has.
inline Errors CalibrateSimulated(const Rig& rig,
                                 const Calibration& truth,
                                 const Calibration& expected,
                                 std::uint64_t seed,
                                 const SessionKind& kind = {}) {
  SimulationOptions options;
  options.seed = seed;
  options.landmarks_in_view = kind.landmarks_in_view;
  options.keyframes_per_segment = 30;
  const std::vector<MotionSegment> segments =
      SimulateKind(rig, truth, options, kind);
  EXPECT_EQ(segments.size(), 4u);
  const CalibrationResult result = Calibrate(rig, rig.factory, segments);
  EXPECT_EQ(result.status, CalibrateStatus::kConverged)
      << "seed " << seed << ": " << result.message;
  const std::vector<int> free = FreeComponents(rig);
  EXPECT_EQ(result.rank, static_cast<int>(free.size()) - kind.undetermined);
  return {BoxMinus(result.theta, expected)(free),
          result.covariance(free, free)};
}

inline Errors CalibrateSimulated(const Rig& rig,
                                 const Calibration& truth,
                                 std::uint64_t seed,
                                 const SessionKind& kind = {}) {
  return CalibrateSimulated(rig, truth, truth, seed, kind);
}

// Expects of some seeds together: the sum of NEES within 99.9 % of its
// chi-square distribution (Wilson and Hilferty), 3 sigma at least as often as
// of normal errors.
template <typename Run>
void ExpectConsistent(int seeds, const Run& run) {
  double nees = 0;
  int components = 0, within = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    const Errors errors = run(static_cast<std::uint64_t>(seed));
    const auto size = static_cast<int>(errors.error.size());
    std::printf("seed %d: NEES %.1f of %d\n", seed, errors.Nees(), size);
    nees += errors.Nees();
    components += size;
    within += errors.Within(3);
  }
  const double n = components;
  const auto quantile = [&](double z) {
    return n * std::pow(1 - 2 / (9 * n) + z * std::sqrt(2 / (9 * n)), 3);
  };
  std::printf("NEES %.1f of %d, within [%.1f, %.1f]; 3 sigma: %.2f %%\n",
              nees,
              components,
              quantile(-3.29),
              quantile(3.29),
              100.0 * within / components);
  EXPECT_GT(nees, quantile(-3.29));
  EXPECT_LT(nees, quantile(3.29));
  EXPECT_GE(within, 0.985 * components);
}

}  // namespace selfcal
