// Saturation: more readings exactly at the extreme of an axis than just below
// it. Clipped readings accumulate there; a sensor with noise reads its extreme
// once, and one with coarse steps reads it less often than the steps below it.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "core/preflight/checks.h"

namespace selfcal {
namespace {

// Minimum number of readings at the extreme, absolute and relative to those
// just below it.
constexpr std::size_t kMinAtExtreme = 5;
constexpr std::size_t kMinRatio = 2;
// Width of the range just below the extreme: this fraction of half the range,
// and at least this many of the sensor's steps.
constexpr double kMargin = 0.01;
constexpr double kMarginSteps = 3;

using Reading = Eigen::Matrix<double, 6, 1>;

Reading ReadingOf(const ImuSample& sample) {
  Reading reading;
  reading << sample.gyro, sample.accel;
  return reading;
}

// Extremes of each axis and the smallest step between neighbouring readings.
struct Extent {
  Reading low = Reading::Constant(std::numeric_limits<double>::max());
  Reading high = -low;
  Reading step = low;
};

Extent Measure(std::span<const MotionSegment> segments) {
  Extent extent;
  for (const MotionSegment& segment : segments) {
    const std::span<const ImuSample> imu = SamplesBetweenKeyframes(segment);
    for (std::size_t i = 0; i < imu.size(); ++i) {
      const Reading reading = ReadingOf(imu[i]);
      if (!reading.allFinite()) continue;
      extent.low = extent.low.cwiseMin(reading);
      extent.high = extent.high.cwiseMax(reading);
      if (i == 0) continue;
      const Reading step = (reading - ReadingOf(imu[i - 1])).cwiseAbs();
      for (int axis = 0; axis < 6; ++axis) {
        if (step[axis] > 0 && step[axis] < extent.step[axis]) {
          extent.step[axis] = step[axis];
        }
      }
    }
  }
  return extent;
}

struct Pile {
  std::size_t at_extreme = 0;
  std::size_t before = 0;

  bool IsSignificant() const {
    return at_extreme >= kMinAtExtreme && at_extreme > kMinRatio * before;
  }
};

// Counts readings; those that repeat all axes of the sensor are not new
// measurements.
Pile CountPile(std::span<const MotionSegment> segments,
               int axis,
               double extreme,
               double margin) {
  Pile pile;
  for (const MotionSegment& segment : segments) {
    Eigen::Vector3d last = Eigen::Vector3d::Constant(std::nan(""));
    for (const ImuSample& sample : SamplesBetweenKeyframes(segment)) {
      const Eigen::Vector3d& reading = axis < 3 ? sample.gyro : sample.accel;
      if (reading == last) continue;
      last = reading;
      const double distance = std::abs(reading[axis % 3] - extreme);
      if (distance == 0) {
        ++pile.at_extreme;
      } else if (distance <= margin) {
        ++pile.before;
      }
    }
  }
  return pile;
}

void Report(int axis,
            double extreme,
            const Pile& pile,
            std::size_t samples,
            Diagnosis* diagnosis) {
  const bool gyro = axis < 3;
  const std::string sensor = gyro ? "gyroscope" : "accelerometer";
  diagnosis->findings.push_back(
      {FindingKind::kSaturation,
       "the " + sensor + " saturates: its " + "xyz"[axis % 3] +
           " axis stands " + std::to_string(pile.at_extreme) +
           " times at its extreme of " + Figure(extreme) +
           (gyro ? " rad/s" : " m/s^2") + ", and only " +
           std::to_string(pile.before) + " times just before it",
       "set a wider range of the " + sensor + ", or move more gently",
       static_cast<double>(pile.at_extreme) / static_cast<double>(samples)});
}

}  // namespace

void CheckSaturation(std::span<const MotionSegment> segments,
                     Diagnosis* diagnosis) {
  std::size_t samples = 0;
  for (const MotionSegment& segment : segments) {
    samples += SamplesBetweenKeyframes(segment).size();
  }
  if (samples == 0) {
    diagnosis->not_checked.push_back("saturation: no samples");
    return;
  }
  const Extent extent = Measure(segments);
  for (int axis = 0; axis < 6; ++axis) {
    const double half = (extent.high[axis] - extent.low[axis]) / 2;
    const double margin =
        std::max(kMargin * half, kMarginSteps * extent.step[axis]);
    if (!(half > margin)) continue;
    for (const double extreme : {extent.low[axis], extent.high[axis]}) {
      const Pile pile = CountPile(segments, axis, extreme, margin);
      if (pile.IsSignificant()) Report(axis, extreme, pile, samples, diagnosis);
    }
  }
  diagnosis->checked.push_back("saturation: " + std::to_string(samples) +
                               " samples");
}

}  // namespace selfcal
