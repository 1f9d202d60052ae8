#include "core/motion/estimate_motion.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "core/calibration/partition.h"
#include "core/calibration/problem.h"
#include "core/calibration/subspace.h"
#include "core/calibration/working_point.h"
#include "core/factor/preintegration.h"
#include "core/model/camera.h"
#include "core/model/temperature.h"

namespace selfcal {
namespace {

constexpr int kMaxSteps = 30;
// The estimate is at its minimum if two steps in turn lower the cost by less
// than this fraction each.
constexpr double kSmallDecrease = 1e-4;
constexpr int kSmallSteps = 2;
// Fewer landmarks, or a smaller part of the observations, are no motion.
constexpr int kMinLandmarks = 12;
constexpr double kMinUsed = 0.4;
// Calibrations of which little is known (5 % of the focal length, 3 degrees, 20
// ms) leave at most 0.03 rad, tracks and readings of different motions 0.2.
constexpr double kMaxRms_rad = 0.08;

ThetaSubspace AllHeld(const Rig& rig) {
  ThetaSubspace subspace = WholeSubspace(rig);
  std::swap(subspace.estimated, subspace.held);
  return subspace;
}

// False if the states are not determined.
bool Descend(WorkingPoint* point) {
  if (!point->HoldAssessed(AllHeld(point->rig()))) return false;
  int small = 0;
  for (int i = 0; i < kMaxSteps && small < kSmallSteps; ++i) {
    const double before = point->linearised().cost;
    const StepOutcome step = point->Step();
    if (!step.lower) break;
    small = before - step.cost < kSmallDecrease * before ? small + 1 : 0;
    if (!point->RepeatSelection()) return false;
  }
  return true;
}

// Least scale of the cameras [px/rad].
double LeastScale(const Calibration& theta) {
  double least = std::numeric_limits<double>::infinity();
  for (const CameraCalibration& camera : theta.cameras) {
    least = std::min(least, PixelsPerRadian(camera).minCoeff());
  }
  return least;
}

void Store(const WorkingPoint& point, MotionSegment* segment) {
  segment->keyframes = point.estimate().keyframes;
  std::map<std::uint64_t, Landmark*> by_id;
  for (Landmark& landmark : segment->landmarks) {
    by_id[landmark.id] = &landmark;
  }
  for (const ScreenedLandmark& landmark : point.screening().landmarks) {
    by_id[point.problem().tracks[landmark.track].id]->p_G =
        landmark.position.Point();
  }
}

}  // namespace

MotionEstimate EstimateMotion(const Rig& rig,
                              const Calibration& theta,
                              const MotionStart& start,
                              MotionSegment* segment) {
  MotionEstimate result;
  result.observations = static_cast<int>(segment->observations.size());
  if (!AlignMotion(rig, *SegmentTheta(theta, *segment), start, segment)) {
    result.failure = "the tracks and the readings do not agree with one motion";
    return result;
  }
  const std::vector<const MotionSegment*> segments = {segment};
  const CalibrateOptions options;
  WorkingPoint point(
      rig,
      theta,
      FlattenSegments(
          rig, segments, PartitionSegments(segments, options.merge_landmarks)),
      options);
  if (!Descend(&point)) {
    result.failure = "the tracks do not determine the motion";
    return result;
  }
  const Screening& screening = point.screening();
  result.used = screening.observations;
  result.landmarks = static_cast<int>(screening.landmarks.size());
  result.reprojection_rms_px = point.MeasureReprojections().rms_px;
  if (result.landmarks < kMinLandmarks) {
    result.failure = "too few landmarks have parallax";
  } else if (result.used < kMinUsed * result.observations ||
             result.reprojection_rms_px > kMaxRms_rad * LeastScale(theta)) {
    result.failure = "most of the tracks do not agree with one motion";
  }
  Store(point, segment);
  return result;
}

KeyframeState CarryOn(const Rig& rig,
                      const Calibration& theta,
                      const KeyframeState& x,
                      std::span<const ImuSample> samples,
                      std::int64_t t_ns) {
  const Preintegration motion =
      Preintegrate(samples,
                   x.t_ns,
                   t_ns,
                   theta.imu,
                   x.b_a,
                   x.b_g,
                   rig.imu_noise,
                   {.jacobians = false, .covariance = false});
  const double dt = motion.dt_s;
  const Eigen::Vector3d g_G(0, 0, -rig.gravity_mps2);
  KeyframeState next = x;
  next.t_ns = t_ns;
  next.q_GI = (x.q_GI * motion.Delta_R).normalized();
  next.v_GI = x.v_GI + dt * g_G + x.q_GI * motion.Delta_v;
  next.p_GI =
      x.p_GI + dt * x.v_GI + dt * dt / 2 * g_G + x.q_GI * motion.Delta_p;
  return next;
}

}  // namespace selfcal
