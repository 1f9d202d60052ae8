// Both solvers find the same minimum of a round, and it is a minimum.
#include "core/calibration/solver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "core/calibration/partition.h"
#include "core/calibration/structured_solver.h"
#include "core/calibration/subspace.h"
#include "core/calibration/theta_information.h"
#include "core/model/so3.h"
#include "core/simulation/simulate.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

SimulationOptions SmallestOptions(std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.keyframes_per_segment = 12;
  options.landmarks_in_view = 40;
  return options;
}

// Segments of one session of a rig whose factory calibration is wrong.
std::vector<MotionSegment> Walk(const Rig& rig,
                                const Calibration& truth,
                                const SimulationOptions& options,
                                int segments) {
  const double seconds =
      segments * options.keyframes_per_segment / options.keyframe_rate_hz + 0.5;
  return Simulate(rig,
                  truth,
                  rig.factory,
                  *MakeHandheld(seconds, 1.0, options.seed),
                  "session",
                  options)
      .segments;
}

Rig WrongRig(Rig rig) {
  rig.factory = PerturbCalibration(rig.factory, {}, 1);
  return rig;
}

// A round as a calibration would state it first, from a start near the minimum.
class Posed {
 public:
  Posed(const Rig& rig,
        const Calibration& start,
        std::vector<MotionSegment> segments,
        const CalibrateOptions& options = {})
      : rig_(rig),
        reference_(options.prior ? options.prior->centre : start),
        segments_(std::move(segments)),
        sorted_(SortByKey(segments_)),
        partitioning_(PartitionSegments(sorted_, options.merge_landmarks)),
        problem_(FlattenSegments(rig, sorted_, partitioning_)),
        start_{BoxMinus(start, reference_), problem_.keyframes},
        motions_(Motions(rig, start, problem_)),
        screening_(
            ScreenLandmarks(rig,
                            start,
                            problem_,
                            problem_.keyframes,
                            motions_,
                            {.kind = options.loss, .scale = options.loss_scale},
                            nullptr)),
        whitening_(WhitenInertialLinks(
            rig, ChainThetas(start, problem_), problem_, problem_.keyframes)),
        subspace_(WholeSubspace(rig)),
        prior_(options.prior) {}

  // Holds the directions with the least information from the data.
  void Hold(int directions) {
    basis_ = TangentBasis(rig_, subspace_);
    LinearisedRound linearised;
    ASSERT_TRUE(LineariseRound(
        Round(), start_, screening_.landmarks, nullptr, &linearised));
    subspace_ = ObservedSubspace(rig_, linearised.by_offset.Lambda, directions);
    ASSERT_EQ(subspace_.held.cols(), directions);
  }

  // Solves with both solvers, and expects the same result.
  void ExpectSameMinimum() {
    basis_ = TangentBasis(rig_, subspace_);
    const Solved structured = Solve(SolverKind::kStructured);
    const Solved ceres = Solve(SolverKind::kCeres);
    ASSERT_EQ(structured.outcome.status, SolverStatus::kConverged);
    ASSERT_EQ(ceres.outcome.status, SolverStatus::kConverged);
    EXPECT_NEAR(structured.outcome.initial_cost,
                ceres.outcome.initial_cost,
                1e-9 * ceres.outcome.initial_cost);
    EXPECT_GT(ceres.outcome.initial_cost, 1.5 * ceres.outcome.final_cost)
        << "the start must be away from the minimum";
    EXPECT_NEAR(structured.outcome.final_cost,
                ceres.outcome.final_cost,
                1e-6 * ceres.outcome.final_cost);
    EXPECT_LT(structured.outcome.iterations, ceres.outcome.iterations);
    EXPECT_LT(LargestInSigmas(structured.estimate.d - ceres.estimate.d,
                              Covariance(structured)),
              1e-3);
    ExpectMinimum(structured);
  }

  const CalibrationProblem& problem() const { return problem_; }
  const Partitioning& partitioning() const { return partitioning_; }
  const ThetaSubspace& subspace() const { return subspace_; }
  const Screening& screening() const { return screening_; }
  Screening* mutable_screening() { return &screening_; }

 private:
  struct Solved {
    SolverOutcome outcome;
    CalibrationEstimate estimate;
    std::vector<ScreenedLandmark> landmarks;
  };

  static KeyframeMotions Motions(const Rig& rig,
                                 const Calibration& theta,
                                 const CalibrationProblem& problem) {
    KeyframeMotions motions;
    MeasureMotions(rig, theta, problem, problem.keyframes, &motions);
    return motions;
  }

  SolverRound Round() const {
    return {.rig = rig_,
            .reference = reference_,
            .problem = problem_,
            .motions = motions_,
            .whitening = whitening_,
            .basis = basis_,
            .loss = screening_.loss,
            .prior_information = prior_ ? &prior_->information : nullptr,
            .threads = 1,
            .max_iterations = 300,
            .function_tolerance = 1e-12};
  }

  Solved Solve(SolverKind kind) const {
    Solved solved{{}, start_, screening_.landmarks};
    const auto go_on = [](int, double, const Eigen::VectorXd&) {
      return SolverSignal::kGoOn;
    };
    solved.outcome =
        SolveRound(kind, Round(), go_on, &solved.estimate, &solved.landmarks);
    return solved;
  }

  Eigen::MatrixXd Covariance(const Solved& solved) const {
    LinearisedRound linearised;
    EXPECT_TRUE(LineariseRound(Round(),
                               solved.estimate,
                               solved.landmarks,
                               &screening_.loss,
                               &linearised));
    return SubspaceCovariance(rig_, subspace_, linearised.by_offset.Lambda);
  }

  // Along each direction of theta, each coordinate of some keyframes and of
  // some landmarks, differences of the cost show no slope: its minimum is not
  // 1e-4 standard deviations away.
  void ExpectMinimum(const Solved& solved) const {
    const auto expect_middle = [&](const auto& move, double h) {
      const auto cost = [&](double by) {
        Solved moved = solved;
        move(by, &moved);
        return RoundCost(Round(), moved.estimate, moved.landmarks);
      };
      const double curvature = (cost(h) + cost(-h) - 2 * cost(0)) / (h * h);
      ASSERT_GT(curvature, 0);
      // All other unknowns are held.
      const double sigma = 1 / std::sqrt(curvature);
      const double step = 0.01 * sigma;
      const double slope = (cost(step) - cost(-step)) / (2 * step);
      EXPECT_LT(std::abs(slope / curvature), 1e-4 * sigma);
    };
    for (int i = 0; i < basis_.cols(); ++i) {
      const Eigen::VectorXd direction = basis_.col(i);
      expect_middle(
          [&](double by, Solved* s) { s->estimate.d += by * direction; }, 1e-4);
    }
    const int keyframes = static_cast<int>(problem_.keyframes.size());
    for (const int k : {1, keyframes / 2, keyframes - 1}) {
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3d axis = Eigen::Vector3d::Unit(i);
        const auto state = [&](Solved* s) -> KeyframeState& {
          return s->estimate.keyframes[k];
        };
        expect_middle(
            [&](double by, Solved* s) {
              state(s).q_GI = state(s).q_GI * Exp(by * axis);
            },
            1e-5);
        expect_middle([&](double by, Solved* s) { state(s).p_GI += by * axis; },
                      1e-4);
        expect_middle([&](double by, Solved* s) { state(s).v_GI += by * axis; },
                      1e-3);
        expect_middle([&](double by, Solved* s) { state(s).b_a += by * axis; },
                      1e-2);
        expect_middle([&](double by, Solved* s) { state(s).b_g += by * axis; },
                      1e-4);
      }
    }
    for (const std::size_t i : {std::size_t{0}, solved.landmarks.size() / 2}) {
      for (int j = 0; j < 3; ++j) {
        expect_middle(
            [&](double by, Solved* s) {
              s->landmarks[i].position.inverse_depth(j) += by;
            },
            1e-3);
      }
    }
  }

  const Rig rig_;
  const Calibration reference_;
  const std::vector<MotionSegment> segments_;
  const std::vector<const MotionSegment*> sorted_;
  const Partitioning partitioning_;
  const CalibrationProblem problem_;
  const CalibrationEstimate start_;
  const KeyframeMotions motions_;
  Screening screening_;
  const std::vector<InertialMatrix> whitening_;
  ThetaSubspace subspace_;
  const std::optional<ThetaPrior> prior_;
  Eigen::MatrixXd basis_;
};

// theta is at the truth, the states are as a SLAM system gave them.
Posed Simple(const CalibrateOptions& options,
             const SimulationOptions& simulation,
             const Rig& true_rig = HandheldRig("r")) {
  const Rig rig = WrongRig(true_rig);
  return {rig,
          true_rig.factory,
          Walk(rig, true_rig.factory, simulation, 3),
          options};
}

TEST(Solvers, AgreeWithoutALoss) {
  Simple({.loss = LossKind::kNone}, SmallestOptions(1)).ExpectSameMinimum();
}

TEST(Solvers, AgreeWithHuber) {
  Simple({.loss = LossKind::kHuber}, SmallestOptions(2)).ExpectSameMinimum();
}

TEST(Solvers, AgreeWithCauchyAndOutliers) {
  SimulationOptions simulation = SmallestOptions(3);
  simulation.outlier_fraction = 0.05;
  Simple({.loss = LossKind::kCauchy}, simulation).ExpectSameMinimum();
}

TEST(Solvers, AgreeWithFixedComponents) {
  Rig rig = HandheldRig("r");
  rig.fixed = {"imu.q_AI.*", "cam0.distortion.w"};
  Simple({}, SmallestOptions(4), rig).ExpectSameMinimum();
}

TEST(Solvers, AgreeOnTwoImusAcrossGaps) {
  Rig rig = HandheldRig("r");
  AddSecondImu(&rig);
  rig.blocks = {{"imu1.time_offset", true}};
  rig.factory.imu1->time_offset_s = 1e-3;
  const Calibration truth = rig.factory;
  rig = WrongRig(rig);
  std::vector<MotionSegment> segments =
      Walk(rig, truth, SmallestOptions(13), 5);
  segments.erase(segments.begin() + 2);
  Posed posed(rig, truth, segments);
  EXPECT_EQ(posed.problem().bias_links.size(), 1u);
  EXPECT_EQ(posed.partitioning().joints.size(), 2u);
  posed.ExpectSameMinimum();
}

// Chains of different temperatures, of a device with slopes.
TEST(Solvers, AgreeOnSlopesWithTemperature) {
  Rig rig = HandheldRig("r");
  rig.factory = WithSlopes(rig.factory);
  rig.factory.imu.q_AI_slope = Eigen::Vector3d(1e-4, -2e-4, 1e-4);
  rig.factory.cameras[0].p_CI_slope = Eigen::Vector3d(1e-5, 2e-5, -1e-5);
  rig.factory.cameras[0].c_slope = Eigen::Vector2d(0.02, -0.03);
  rig.blocks = {{"*_slope", true}};
  const Calibration truth = rig.factory;
  rig = WrongRig(rig);
  SimulationOptions simulation = SmallestOptions(12);
  simulation.keyframes_per_segment = 30;
  Posed posed(
      rig,
      truth,
      SimulateAtTemperatures(rig, truth, {-10, 30, 31, 70}, simulation));
  EXPECT_EQ(posed.problem().chain_temperatures_c,
            (std::vector<double>{-10, 30, 31, 70}));
  posed.ExpectSameMinimum();
}

TEST(Solvers, AgreeWithAPrior) {
  Rig rig = HandheldRig("r");
  rig.prior_sigmas = {{"cam0.focal.*", 1e-2}};
  Simple({.prior = FactoryPrior(WrongRig(rig))}, SmallestOptions(5), rig)
      .ExpectSameMinimum();
}

TEST(Solvers, AgreeWithDirectionsHeld) {
  Posed posed = Simple({}, SmallestOptions(6));
  posed.Hold(3);
  posed.ExpectSameMinimum();
}

TEST(Solvers, AgreeOnWeightedLandmarks) {
  Posed posed = Simple({}, SmallestOptions(7));
  for (std::size_t i = 0; i < posed.screening().landmarks.size(); i += 2) {
    posed.mutable_screening()->landmarks[i].weight = 0.3;
  }
  posed.ExpectSameMinimum();
}

TEST(Solvers, AgreeAcrossGapsAndSessions) {
  const Rig rig = WrongRig(HandheldRig("r"));
  const Calibration truth = HandheldRig("r").factory;
  SimulationOptions simulation = SmallestOptions(8);
  simulation.revisit_fraction = 0;
  std::vector<MotionSegment> segments = Walk(rig, truth, simulation, 4);
  segments.erase(segments.begin() + 1, segments.begin() + 3);
  simulation.seed = 9;
  for (MotionSegment& segment : Walk(rig, truth, simulation, 2)) {
    segment.key.session = "another";
    segments.push_back(segment);
  }
  Posed posed(rig, truth, segments);
  EXPECT_EQ(posed.problem().bias_links.size(), 1u);
  EXPECT_EQ(posed.partitioning().joints.size(), 1u);
  EXPECT_EQ(posed.partitioning().partitions.size(), 3u);
  posed.ExpectSameMinimum();
}

TEST(Solvers, AgreeWhereLandmarksConnectDistantKeyframes) {
  const Rig rig = WrongRig(HandheldRig("r"));
  const Calibration truth = HandheldRig("r").factory;
  SimulationOptions simulation = SmallestOptions(10);
  simulation.revisit_fraction = 0.5;
  std::vector<MotionSegment> segments = Walk(rig, truth, simulation, 4);
  segments.erase(segments.begin() + 1, segments.begin() + 3);
  Posed posed(rig, truth, segments, {.merge_landmarks = 0});
  EXPECT_EQ(posed.partitioning().partitions.size(), 1u);
  EXPECT_EQ(posed.problem().chain_starts.size(), 2u);
  posed.ExpectSameMinimum();
}

Rig TwoCameraRig() {
  Rig rig = HandheldRig("r");
  CameraCalibration second = rig.factory.cameras[0];
  second.model = DistortionModel::kRadialTangential;
  second.distortion.resize(4);
  second.distortion << -0.05, 0.01, 2e-4, -1e-4;
  second.f = {420, 421};
  second.p_CI += Eigen::Vector3d(0.08, 0.01, 0);
  second.q_CI = Exp(Eigen::Vector3d(0.05, -0.1, 0.02)) * second.q_CI;
  rig.factory.cameras.push_back(second);
  return rig;
}

TEST(Solvers, AgreeWithTwoCameras) {
  Simple({}, SmallestOptions(11), TwoCameraRig()).ExpectSameMinimum();
}

TEST(Solvers, AgreeWithKnownTimeOffsets) {
  Rig rig = TwoCameraRig();
  rig.factory.cameras[0].time_offset_s = 0.02;
  rig.factory.cameras[1].time_offset_s = -0.013;
  Simple({}, SmallestOptions(12), rig).ExpectSameMinimum();
}

TEST(Solvers, AgreeWithEstimatedTimeOffsets) {
  Rig rig = TwoCameraRig();
  rig.blocks = {{"*.time_offset", true}};
  rig.factory.cameras[0].time_offset_s = 0.02;
  // The first is known, the second estimated, starting without a motion.
  rig.fixed = {"cam0.time_offset"};
  Simple({}, SmallestOptions(13), rig).ExpectSameMinimum();
  rig.fixed.clear();
  rig.factory.cameras[1].time_offset_s = -0.013;
  Simple({}, SmallestOptions(14), rig).ExpectSameMinimum();
}

}  // namespace
}  // namespace selfcal
