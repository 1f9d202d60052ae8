#include "core/information/segment_ends.h"

#include <algorithm>

#include "core/elimination/by_theta.h"
#include "core/information/inliers.h"
#include "core/information/linearisation.h"
#include "core/information/observation_order.h"
#include "core/model/second_imu.h"
#include "core/model/temperature.h"

namespace selfcal {
namespace {

// Samples before the last keyframe, which the integration needs as neighbours.
constexpr int kSamplesBefore = 2;

std::vector<ImuSample> Tail(const MotionSegment& segment) {
  const auto after =
      std::upper_bound(segment.imu.begin(),
                       segment.imu.end(),
                       segment.keyframes.back().t_ns,
                       [](std::int64_t t_ns, const ImuSample& sample) {
                         return t_ns < sample.t_ns;
                       });
  const auto before =
      std::min<std::ptrdiff_t>(kSamplesBefore, after - segment.imu.begin());
  return {after - before, segment.imu.end()};
}

}  // namespace

SegmentEnds SummariseEnds(const Rig& rig,
                          const Calibration& theta0,
                          const MotionSegment& given,
                          const ScoreOptions& options) {
  const SegmentTheta theta_s(theta0, given);
  const StartedSegment started(*theta_s, given);
  const MotionSegment& segment = *started;
  ObservationOrder order;
  order.Find(segment, static_cast<int>(theta0.cameras.size()));
  const KeyframeMotions motions = SegmentMotions(rig, *theta_s, segment);
  InlierSelector selector;
  SegmentLineariser lineariser;
  SharedInformation information =
      lineariser
          .EliminateToEnds(rig,
                           *theta_s,
                           segment,
                           motions,
                           selector.Select(*theta_s,
                                           rig.pixel_sigma_px,
                                           segment,
                                           motions,
                                           order,
                                           options),
                           order)
          .theta;
  const double temperature_c = TemperatureOf(theta0, segment);
  if (theta_s.varies()) {
    information =
        ByTheta(TemperatureDerivative(theta0, temperature_c), information);
  }
  std::vector<int> used = FreeComponents(rig);
  const auto size = static_cast<int>(information.eta.size());
  for (int i = TangentSize(theta0); i < size; ++i) used.push_back(i);
  SegmentEnds ends{.key = segment.key,
                   .theta0 = theta0,
                   .temperature_c = temperature_c,
                   .first = segment.keyframes.front(),
                   .last = segment.keyframes.back(),
                   .Lambda = Eigen::MatrixXd::Zero(size, size),
                   .eta = Eigen::VectorXd::Zero(size),
                   .tail = Tail(segment)};
  ends.Lambda(used, used) = information.Lambda(used, used);
  ends.eta(used) = information.eta(used);
  return ends;
}

}  // namespace selfcal
