#include "core/model/motion_statistics.h"

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <span>

namespace selfcal {
namespace {

Eigen::Vector3d MeanGyroBias(std::span<const KeyframeState> keyframes) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const KeyframeState& x : keyframes) sum += x.b_g;
  return sum / static_cast<double>(keyframes.size());
}

double AngularRate(std::span<const ImuSample> samples,
                   const Eigen::Vector3d& b_g) {
  double sum = 0;
  for (const ImuSample& sample : samples) {
    sum += (sample.gyro - b_g).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(samples.size()));
}

double Acceleration(std::span<const KeyframeState> keyframes) {
  double sum = 0;      // of the squares, each times its interval
  double total_s = 0;  // of the intervals
  for (std::size_t k = 1; k < keyframes.size(); ++k) {
    const KeyframeState& from = keyframes[k - 1];
    const KeyframeState& to = keyframes[k];
    const double interval_s = 1e-9 * static_cast<double>(to.t_ns - from.t_ns);
    sum += (to.v_GI - from.v_GI).squaredNorm() / interval_s;
    total_s += interval_s;
  }
  return std::sqrt(sum / total_s);
}

}  // namespace

MotionStatistics MotionStatisticsOf(const MotionSegment& segment) {
  return {AngularRate(SamplesBetweenKeyframes(segment),
                      MeanGyroBias(segment.keyframes)),
          Acceleration(segment.keyframes)};
}

}  // namespace selfcal
