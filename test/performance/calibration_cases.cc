// Recalibration on 8 segments of one session, from a factory's calibration.
#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/partition.h"
#include "core/calibration/problem.h"
#include "core/calibration/screening.h"
#include "core/calibration/structured_solver.h"
#include "core/calibration/subspace.h"
#include "core/calibration/theta_information.h"
#include "core/information/fusion.h"
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

// Where what the segments say, and the prior, have their optimum.
Calibration FusedCalibration(const Scene& scene) {
  std::vector<SegmentInformation> information;
  for (const MotionSegment& segment : scene.segments) {
    information.push_back(ScoreSegment(scene.rig, scene.rig.factory, segment));
  }
  return Fuse(scene.rig, information).theta;
}

Measurement StructuredAgainstCeres(const TimingOptions& options) {
  const Scene scene = MakeCalibrationScene();
  // What both share afterwards is left out.
  CalibrateOptions ceres, structured;
  ceres.solver = SolverKind::kCeres;
  structured.solver = SolverKind::kStructured;
  ceres.noise_scales = structured.noise_scales = false;
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

Measurement NoiseScalesAgainstNone(const TimingOptions& options) {
  const Scene scene = MakeCalibrationScene();
  CalibrateOptions with, without;
  without.noise_scales = false;
  int iterations = 0;
  return CompareTimes(CalibrationOf("with", scene, with, &iterations),
                      CalibrationOf("without", scene, without, &iterations),
                      Fewer(options));
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

// The first round of a calibration from the factory's, all of theta estimated,
// with a Huber loss alone: where weights fade out at a gate, a landmark may
// have several minima, and from a start so far off the ways differ in which
// they take.
class FirstRound {
 public:
  explicit FirstRound(const Scene& scene)
      : rig_(scene.rig),
        sorted_(SortByKey(scene.segments)),
        problem_(FlattenSegments(
            rig_,
            sorted_,
            PartitionSegments(sorted_, CalibrateOptions().merge_landmarks))),
        screening_(ScreenLandmarks(rig_,
                                   rig_.factory,
                                   problem_,
                                   problem_.keyframes,
                                   motions_,
                                   {},
                                   nullptr)),
        whitening_(WhitenInertialLinks(
            rig_, rig_.factory, problem_, problem_.keyframes)),
        basis_(TangentBasis(rig_, WholeSubspace(rig_))) {}

  SolverRound Posed(double function_tolerance) const {
    return {.rig = rig_,
            .reference = rig_.factory,
            .problem = problem_,
            .motions = motions_,
            .whitening = whitening_,
            .basis = basis_,
            .loss = loss_,
            .function_tolerance = function_tolerance};
  }

  // An estimate, with what it costs.
  struct Point {
    CalibrationEstimate estimate;
    std::vector<ScreenedLandmark> landmarks;
    SolverOutcome outcome;
  };

  Point Start() const {
    return {
        {Eigen::VectorXd::Zero(TangentSize(rig_.factory)), problem_.keyframes},
        screening_.landmarks,
        {}};
  }

  void Linearise(const Point& at, LinearisedRound* linearised) const {
    LineariseRound(Posed(0), at.estimate, at.landmarks, &loss_, linearised);
  }

  Eigen::MatrixXd Covariance(const LinearisedRound& linearised) const {
    return SubspaceCovariance(
        rig_, WholeSubspace(rig_), linearised.by_offset.Lambda);
  }

  TimedFunction Solution(const std::string& name,
                         SolverKind kind,
                         Point* solved) const {
    return {
        name, [this, kind, solved] {
          *solved = Start();
          const auto go_on = [](int, double, const Eigen::VectorXd&) {
            return SolverSignal::kGoOn;
          };
          // Both end within 1e-6 of the cost of the minimum.
          solved->outcome = SolveRound(
              kind, Posed(1e-9), go_on, &solved->estimate, &solved->landmarks);
        }};
  }

 private:
  const Rig& rig_;
  const std::vector<const MotionSegment*> sorted_;
  const CalibrationProblem problem_;
  const KeyframeMotions motions_;  // none: no camera has an offset
  const Screening screening_;
  const RobustLoss loss_;
  const std::vector<InertialMatrix> whitening_;
  const Eigen::MatrixXd basis_;
};

// One round to its minimum, the same for both.
Measurement RoundAgainstCeres(const TimingOptions& options) {
  const Scene scene = MakeCalibrationScene();
  const FirstRound round(scene);
  FirstRound::Point ceres, structured;
  Measurement result = CompareTimes(
      round.Solution("Ceres", SolverKind::kCeres, &ceres),
      round.Solution("structured", SolverKind::kStructured, &structured),
      Fewer(options));
  LinearisedRound linearised;
  round.Linearise(structured, &linearised);
  result.figures["Ceres iterations"] = ceres.outcome.iterations;
  result.figures["structured iterations"] = structured.outcome.iterations;
  result.figures["cost, relative difference"] =
      structured.outcome.final_cost / ceres.outcome.final_cost - 1;
  result.figures["theta, difference in sigma"] = LargestInSigmas(
      structured.estimate.d - ceres.estimate.d, round.Covariance(linearised));
  return result;
}

// The covariance of theta against one iteration of the whole calibration: what
// is left to do when that has eliminated down to theta.
Measurement CovarianceAgainstIteration(const TimingOptions& options) {
  const Scene scene = MakeCalibrationScene();
  const FirstRound round(scene);
  LinearisedRound linearised;
  round.Linearise(round.Start(), &linearised);
  int iterations = 0;
  Measurement result = CompareTimes(
      {"covariance",
       [&] { benchmark::DoNotOptimize(round.Covariance(linearised)); }},
      CalibrationOf("calibration", scene, {}, &iterations),
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
          {.name = "one round of it, to the same minimum",
           .must = 8,
           .goal = 12,
           .measure = RoundAgainstCeres},
          {.name = "noise factors: a calibration with them against without",
           .must = 2,
           .goal = 1.2,
           .higher_is_better = false,
           .measure = NoiseScalesAgainstNone},
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
