#include "core/information/segment_residuals.h"

#include <cmath>
#include <span>

#include "core/factor/keyframe_motion.h"
#include "core/factor/reprojection.h"
#include "core/information/inliers.h"
#include "core/information/observation_order.h"
#include "core/model/second_imu.h"
#include "core/model/temperature.h"

namespace selfcal {
namespace {

std::vector<ObservationResidual> Reprojections(
    const Calibration& theta,
    const MotionSegment& segment,
    const KeyframeMotions& motions,
    const InlierSelection& selected) {
  std::vector<ObservationResidual> residuals;
  residuals.reserve(segment.observations.size());
  for (const Observation& o : segment.observations) {
    const KeyframeState& x = segment.keyframes[o.keyframe];
    ObservationResidual& residual = residuals.emplace_back();
    residual.projects = Reproject(x.q_GI,
                                  x.p_GI,
                                  theta.cameras[o.camera],
                                  selected.landmarks[o.landmark].homogeneous(),
                                  o.z_px,
                                  &residual.residual_px,
                                  nullptr,
                                  motions.At(o.keyframe, o.camera));
  }
  for (const int index : selected.inliers) residuals[index].inlier = true;
  return residuals;
}

std::vector<IntervalResidual> Intervals(const Rig& rig,
                                        const Calibration& theta,
                                        const MotionSegment& segment,
                                        int imu) {
  const std::span<const ImuSample> samples =
      imu == 0 ? SamplesFromFirstKeyframe(segment)
               : SecondSamplesFromFirstKeyframe(segment);
  std::vector<IntervalResidual> intervals;
  for (std::size_t k = 0; k + 1 < segment.keyframes.size(); ++k) {
    InertialMatrix covariance;
    IntervalResidual& interval = intervals.emplace_back();
    interval.residual =
        EvaluateInertial(samples,
                         StateOfImu(theta, imu, segment.keyframes[k]),
                         StateOfImu(theta, imu, segment.keyframes[k + 1]),
                         ImuOf(theta, imu),
                         NoiseOfImu(rig, imu),
                         rig.gravity_mps2,
                         nullptr,
                         &covariance);
    interval.whitened = SquareRootInformation(covariance) * interval.residual;
  }
  return intervals;
}

// Root mean squares of the kinds, over at least one interval.
std::vector<double> InertialRms(
    const std::vector<IntervalResidual>& intervals) {
  std::vector<double> rms(kStateKinds, 0);
  for (const IntervalResidual& interval : intervals) {
    for (int j = 0; j < kStateTangentSize; ++j) {
      rms[j / 3] += interval.whitened[j] * interval.whitened[j];
    }
  }
  for (double& sum : rms) {
    sum = std::sqrt(sum / (3.0 * static_cast<double>(intervals.size())));
  }
  return rms;
}

}  // namespace

SegmentResiduals EvaluateResiduals(const Rig& rig,
                                   const Calibration& theta,
                                   const MotionSegment& segment,
                                   const ScoreOptions& options) {
  const SegmentTheta theta_s(theta, segment);
  const KeyframeMotions motions = SegmentMotions(rig, *theta_s, segment);
  ObservationOrder order;
  order.Find(segment, static_cast<int>(theta.cameras.size()));
  InlierSelector selector;
  const InlierSelection& selected = selector.Select(
      *theta_s, rig.pixel_sigma_px, segment, motions, order, options);
  SegmentResiduals residuals;
  residuals.observations = Reprojections(*theta_s, segment, motions, selected);
  residuals.intervals = Intervals(rig, *theta_s, segment, 0);
  residuals.statistics = selected.statistics;
  residuals.statistics.inertial_rms = InertialRms(residuals.intervals);
  if (theta_s->imu1) {
    const StartedSegment started(*theta_s, segment);
    residuals.second_intervals = Intervals(rig, *theta_s, *started, 1);
    residuals.statistics.second_inertial_rms =
        InertialRms(residuals.second_intervals);
  }
  return residuals;
}

}  // namespace selfcal
