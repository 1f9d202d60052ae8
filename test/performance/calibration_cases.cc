// Recalibration on 8 segments of one session, from a factory's calibration.
#include <benchmark/benchmark.h>

#include <Eigen/Cholesky>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/partition.h"
#include "core/calibration/problem.h"
#include "core/calibration/screening.h"
#include "core/calibration/structured_solver.h"
#include "core/calibration/subspace.h"
#include "core/calibration/theta_information.h"
#include "core/information/segment_information.h"
#include "test/performance/cases.h"
#include "test/performance/scene.h"

namespace selfcal {
namespace {

// Every other segment of a session: gaps between them, landmarks seen again.
Scene MakeCalibrationScene() { return MakeScene({.segments = 8, .every = 2}); }

// A calibration takes seconds; it needs fewer repetitions than a score.
TimingOptions Fewer(TimingOptions options) {
  options.repetitions = (options.repetitions + 4) / 5;
  return options;
}

// A whole calibration from the factory's.
TimedFunction CalibrationOf(const std::string& name,
                            const Scene& scene,
                            const CalibrateOptions& options,
                            int* iterations) {
  return {name, [&scene, options, iterations] {
            *iterations =
                Calibrate(scene.rig, scene.rig.factory, scene.segments, options)
                    .iterations;
          }};
}

// The optimum of the sum of what the segments say and of the prior.
Calibration FusedCalibration(const Scene& scene) {
  const Rig& rig = scene.rig;
  Eigen::MatrixXd Lambda =
      PriorSigmas(rig).array().square().inverse().matrix().asDiagonal();
  Eigen::VectorXd eta = Eigen::VectorXd::Zero(Lambda.rows());
  for (const MotionSegment& segment : scene.segments) {
    const SegmentInformation information =
        ScoreSegment(rig, rig.factory, segment);
    Lambda += information.Lambda;
    eta += information.eta;
  }
  return BoxPlus(rig.factory, Lambda.llt().solve(eta));
}

Measurement StructuredAgainstCeres(const TimingOptions& options) {
  const Scene scene = MakeCalibrationScene();
  CalibrateOptions ceres, structured;
  ceres.solver = SolverKind::kCeres;
  structured.solver = SolverKind::kStructured;
  int ceres_iterations = 0;
  int structured_iterations = 0;
  Measurement result = CompareTimes(
      CalibrationOf("Ceres", scene, ceres, &ceres_iterations),
      CalibrationOf("structured", scene, structured, &structured_iterations),
      Fewer(options));
  result.figures["Ceres iterations"] = ceres_iterations;
  result.figures["structured iterations"] = structured_iterations;
  return result;
}

Measurement IterationsFromFused(const TimingOptions&) {
  const Scene scene = MakeCalibrationScene();
  const CalibrationResult fused =
      Calibrate(scene.rig, FusedCalibration(scene), scene.segments);
  const CalibrationResult factory =
      Calibrate(scene.rig, scene.rig.factory, scene.segments);
  return {.ratio = static_cast<double>(fused.iterations),
          .figures = {{"from the factory", factory.iterations}}};
}

// The covariance of theta against one iteration of the whole calibration.
Measurement CovarianceAgainstIteration(const TimingOptions& options) {
  const Scene scene = MakeCalibrationScene();
  const Rig& rig = scene.rig;
  const std::vector<const MotionSegment*> sorted = SortByKey(scene.segments);
  const CalibrateOptions calibrate;
  const Partitioning partitioning =
      PartitionSegments(sorted, calibrate.merge_landmarks);
  const CalibrationProblem problem = FlattenSegments(rig, sorted, partitioning);
  const Screening screening = ScreenLandmarks(
      rig, rig.factory, problem, problem.keyframes, calibrate, nullptr);
  const std::vector<InertialMatrix> whitening =
      WhitenInertialLinks(rig, rig.factory.imu, problem, problem.keyframes);
  const Eigen::MatrixXd whole = TangentBasis(rig, WholeSubspace(rig));
  const Eigen::VectorXd d = Eigen::VectorXd::Zero(TangentSize(rig.factory));
  const SolverRound round{.rig = rig,
                          .reference = rig.factory,
                          .problem = problem,
                          .whitening = whitening,
                          .basis = whole,
                          .loss = screening.loss};
  LinearisedRound linearised;
  LineariseRound(round,
                 {d, problem.keyframes},
                 screening.landmarks,
                 &screening.loss,
                 &linearised);
  // What is left to do when an iteration has eliminated down to theta.
  int iterations = 0;
  Measurement result = CompareTimes(
      {"covariance",
       [&] {
         benchmark::DoNotOptimize(SubspaceCovariance(
             rig, WholeSubspace(rig), linearised.by_offset.Lambda));
       }},
      CalibrationOf("calibration", scene, calibrate, &iterations),
      Fewer(options));
  result.ratio *= iterations;
  result.figures["iterations"] = iterations;
  return result;
}

}  // namespace

std::vector<Case> CalibrationCases() {
  return {{.name = "calibrate 8 segments against Ceres SPARSE_SCHUR",
           .must = 8,
           .goal = 12,
           .measure = StructuredAgainstCeres},
          {.name = "iterations from the fused information",
           .must = 3,
           .goal = 2,
           .higher_is_better = false,
           .measure = IterationsFromFused},
          {.name = "covariance of theta against one iteration",
           .must = 1,
           .goal = 0.1,
           .higher_is_better = false,
           .measure = CovarianceAgainstIteration}};
}

}  // namespace selfcal
