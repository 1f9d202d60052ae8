#include "core/calibration/calibration_run.h"

#include <algorithm>
#include <iomanip>
#include <limits>
#include <optional>
#include <sstream>
#include <utility>

#include "core/calibration/descent.h"
#include "core/calibration/held_bends.h"
#include "core/calibration/noise_weighting.h"
#include "core/calibration/partition.h"
#include "core/calibration/problem.h"
#include "core/calibration/theta_information.h"
#include "core/calibration/trusted_directions.h"
#include "core/calibration/working_point.h"
#include "core/model/temperature.h"

namespace selfcal {
namespace {

// What the phases of a calibration work on.
struct Phases {
  const std::vector<const MotionSegment*>& segments;
  const Partitioning& partitioning;
  WorkingPoint* point;
  Descent* descent;
  NoiseWeighting* noise;
  // True once it is known which information stems from noise.
  bool* noise_tested;
};

// Lets weakly observed directions move that are linear within their sigma. The
// functions return false if the calibration ends without a result.
bool ReleaseWeak(const Phases& phases) {
  if (!phases.descent->converged()) return true;
  auto trusted = ReleaseWeakDirections(*phases.point);
  if (!trusted) return true;
  return phases.descent->DescendHolding(*std::move(trusted)) &&
         phases.noise->Reweight();
}

// Holds directions constant whose information stems from noise in states, until
// none is left.
bool HoldSpurious(const Phases& phases) {
  while (phases.descent->converged()) {
    SpuriousTest test = HoldSpuriousDirections(
        phases.segments, phases.partitioning, phases.point);
    *phases.noise_tested = test.made;
    if (!test.remaining) break;
    if (!phases.descent->DescendHolding(*std::move(test.remaining)) ||
        !phases.noise->Reweight()) {
      return false;
    }
  }
  return true;
}

// The noise can be estimated only once residuals are small, and weak directions
// only once all others are estimated.
bool Estimate(const Phases& phases) {
  return phases.descent->Start() && phases.descent->Descend() &&
         phases.noise->Reweight() && ReleaseWeak(phases) &&
         HoldSpurious(phases);
}

std::string MessageOf(const DescentState& state) {
  if (state.status == CalibrateStatus::kConverged) return state.message;
  if (state.status == CalibrateStatus::kStalled) {
    std::ostringstream message;
    message << std::setprecision(2)
            << "no step lowers the cost, and the next one would move theta by "
            << state.remaining_sigmas << " sigma";
    return message.str();
  }
  return "the estimate still moves after " + std::to_string(state.iterations) +
         " iterations";
}

// Expected sum over the two rows of a reprojection, from the redundancy of all;
// 0: unknown.
double ExpectedReprojectionSquares(const std::vector<NoiseScale>& scales,
                                   int observations) {
  for (const NoiseScale& scale : scales) {
    if (scale.kind == NoiseKind::kPixel) {
      return scale.redundancy / std::max(1, observations);
    }
  }
  return 0;
}

// Tests each segment alone, at the minimum. If they disagree by more than their
// information predicts, the covariance is scaled accordingly.
void TestSegments(const std::vector<const MotionSegment*>& segments,
                  const WorkingPoint& point,
                  CalibrationRun* run) {
  CalibrationResult& result = run->result;
  run->evidence =
      CollectEvidence(point,
                      segments,
                      ExpectedReprojectionSquares(
                          result.noise_scales, point.screening().observations));
  const double excess = TestEach(&run->evidence);
  result.covariance *= excess;
  run->estimate = {.reference = point.reference(),
                   .d = point.estimate().d,
                   .subspace = std::move(run->estimate.subspace),
                   .Lambda = point.information().Lambda,
                   .excess = excess,
                   .noise_scale = LargestNoise(result.noise_scales,
                                               point.track_noise_factor())};
  result.halves = TestHalves(run->evidence, excess);
  for (const SegmentEvidence& one : run->evidence) {
    result.segment_fits.push_back(one.fit);
  }
}

void ReportEstimate(const WorkingPoint& point, CalibrationRun* run) {
  CalibrationResult* result = &run->result;
  ThetaSubspace& subspace = run->estimate.subspace = point.subspace();
  subspace.bends = BendsOfHeld(point);
  result->theta = point.theta();
  const Eigen::MatrixXd by_offset =
      ThetaByOffset(point.reference(), point.estimate().d);
  result->covariance =
      by_offset *
      CovarianceWithHeld(point.rig(), subspace, point.information().Lambda) *
      by_offset.transpose();
  result->Lambda = point.linearised().system.information().Lambda;
  result->rank = static_cast<int>(subspace.estimated.cols());
  result->held_constant = subspace.unobserved;
}

void ReportUse(const WorkingPoint& point, CalibrationResult* result) {
  const ReprojectionStatistics after = point.MeasureReprojections();
  result->reprojection_rms_after_px = after.rms_px;
  result->reprojection_median_after_px = after.median_px;
  const Screening& screening = point.screening();
  result->landmarks = static_cast<int>(screening.landmarks.size());
  result->landmarks_dropped = screening.landmarks_dropped;
  result->observations = screening.observations;
  result->observations_dropped = screening.observations_dropped;
}

// Joined segments have one temperature, the mean of theirs: these are within
// this of the first.
constexpr double kMaxWarming_k = 1;

}  // namespace

CalibrationRun RunCalibration(const Rig& rig,
                              const Calibration& theta_start,
                              const std::vector<const MotionSegment*>& segments,
                              const CalibrateOptions& options,
                              const ProgressCallback& progress) {
  const Partitioning partitioning = PartitionSegments(
      segments,
      options.merge_landmarks,
      HasSlopes(rig.factory) ? kMaxWarming_k
                             : std::numeric_limits<double>::infinity());
  WorkingPoint point(
      rig, theta_start, FlattenSegments(rig, segments, partitioning), options);
  Descent descent(options, theta_start, progress, &point);
  NoiseWeighting noise(rig, options, &point, &descent);

  CalibrationRun run;
  CalibrationResult& result = run.result;
  result.segments = static_cast<int>(segments.size());
  result.partitions = static_cast<int>(partitioning.partitions.size());
  result.keyframes = static_cast<int>(point.problem().keyframes.size());
  const ReprojectionStatistics before = point.MeasureReprojections();
  result.reprojection_rms_before_px = before.rms_px;
  result.reprojection_median_before_px = before.median_px;

  bool noise_tested = false;
  const bool estimated = Estimate(
      {segments, partitioning, &point, &descent, &noise, &noise_tested});
  const DescentState& state = descent.state();
  result.status = state.status;
  result.iterations = state.iterations;
  result.initial_cost = state.initial_cost;
  result.final_cost = state.final_cost;
  result.track_noise_factor = point.track_noise_factor();
  if (!estimated) {
    result.message = state.message;
    return run;
  }
  result.noise_scales = noise.ScalesOfStated();
  result.message = MessageOf(state);
  if (descent.converged() && !noise_tested) {
    result.status = CalibrateStatus::kStalled;
    result.message =
        "with noise added once more no minimum is reached, so that it is "
        "unknown which information stems from noise";
  }
  ReportEstimate(point, &run);
  TestSegments(segments, point, &run);
  ReportUse(point, &result);
  // Same cost function as for the initial cost.
  result.final_cost = point.UnweightedCost();
  return run;
}

}  // namespace selfcal
