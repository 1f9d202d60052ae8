// A map that a device observes repeatedly: with a bounded number of landmarks
// that connect distant keyframes the estimate is the one in which all connect,
// with less certainty by the information of the others.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/calibration/partition.h"
#include "core/calibration/problem.h"
#include "core/calibration/screening.h"
#include "core/calibration/structured_solver.h"
#include "core/calibration/subspace.h"
#include "core/calibration/theta_information.h"
#include "core/simulation/simulate.h"

namespace selfcal {
namespace {

struct Estimate {
  Eigen::VectorXd d;  // from the truth
  Eigen::MatrixXd covariance;
  int shared = 0;  // landmarks that connect pieces
};

Estimate Solve(const Rig& rig,
               const std::vector<MotionSegment>& segments,
               const SharingLimits& limits) {
  const std::vector<const MotionSegment*> sorted = SortByKey(segments);
  const CalibrationProblem problem =
      FlattenSegments(rig, sorted, PartitionSegments(sorted, 15), limits);
  KeyframeMotions motions;
  MeasureMotions(rig, rig.factory, problem, problem.keyframes, &motions);
  Screening screening = ScreenLandmarks(
      rig, rig.factory, problem, problem.keyframes, motions, {}, nullptr);
  const std::vector<InertialMatrix> whitening =
      WhitenInertialLinks(rig, rig.factory, problem, problem.keyframes);
  const Eigen::MatrixXd basis = TangentBasis(rig, WholeSubspace(rig));
  const SolverRound round = {.rig = rig,
                             .reference = rig.factory,
                             .problem = problem,
                             .motions = motions,
                             .whitening = whitening,
                             .basis = basis,
                             .loss = screening.loss,
                             .max_iterations = 50,
                             .function_tolerance = 1e-10};
  CalibrationEstimate estimate{Eigen::VectorXd::Zero(TangentSize(rig.factory)),
                               problem.keyframes};
  const auto go_on = [](int, double, const Eigen::VectorXd&) {
    return SolverSignal::kGoOn;
  };
  EXPECT_EQ(SolveRound(SolverKind::kStructured,
                       round,
                       go_on,
                       &estimate,
                       &screening.landmarks)
                .status,
            SolverStatus::kConverged);
  LinearisedRound linearised;
  EXPECT_TRUE(LineariseRound(
      round, estimate, screening.landmarks, &screening.loss, &linearised));
  Estimate result{
      estimate.d,
      SubspaceCovariance(rig, WholeSubspace(rig), linearised.by_offset.Lambda)};
  for (const Track& track : problem.tracks) {
    result.shared += track.later_pieces.empty() ? 0 : 1;
  }
  return result;
}

std::vector<MotionSegment> MapSession(const Rig& rig, std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.landmarks_in_view = 60;
  options.revisit_fraction = 0.9;
  std::vector<MotionSegment> all = Simulate(rig,
                                            rig.factory,
                                            rig.factory,
                                            *MakeHandheld(28.5, 1.0, seed),
                                            "session",
                                            options)
                                       .segments;
  return {all[0], all[2], all[4], all[6]};
}

// Components that the rig does not hold.
std::vector<Eigen::Index> EstimatedComponents(const Estimate& estimate) {
  std::vector<Eigen::Index> components;
  for (Eigen::Index i = 0; i < estimate.d.size(); ++i) {
    if (estimate.covariance(i, i) > 0) components.push_back(i);
  }
  return components;
}

// One landmark more or less survives screening if tracks differ.
constexpr double kScreening = 0.05;

TEST(MapSolution, DiffersFromTheDenseOneByWhatItDiscards) {
  const Rig rig = HandheldRig("r");
  double log_ratios = 0, squares = 0;
  int components = 0;
  for (const std::uint64_t seed : {1, 2, 3}) {
    const std::vector<MotionSegment> segments = MapSession(rig, seed);
    const Estimate dense = Solve(rig, segments, SharingLimits::None());
    const Estimate bounded = Solve(rig, segments, {});
    const Estimate apart = Solve(rig, segments, {.of_chain = 0});
    EXPECT_GT(dense.shared, 3 * bounded.shared);
    EXPECT_GT(bounded.shared, 15);
    EXPECT_EQ(apart.shared, 0);
    for (const Eigen::Index i : EstimatedComponents(dense)) {
      const double variance = dense.covariance(i, i);
      const double ratio = bounded.covariance(i, i) / variance;
      EXPECT_GT(ratio, 1 - kScreening) << "component " << i;
      EXPECT_LT(ratio * (1 - kScreening), apart.covariance(i, i) / variance)
          << "component " << i;
      // If one of two estimates discards information, the covariance of their
      // difference is the difference of their covariances.
      const double square = std::pow(bounded.d[i] - dense.d[i], 2) / variance;
      const double expected = std::max(ratio - 1, 0.0) + kScreening;
      EXPECT_LT(square, 16 * expected) << "component " << i;
      squares += square / expected;
      log_ratios += std::log(ratio) / 2;
      ++components;
    }
  }
  EXPECT_LT(squares / components, 2);
  EXPECT_LT(std::exp(log_ratios / components), 1.4);
}

}  // namespace
}  // namespace selfcal
