// Segments that are as large as a message may be.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/model/segment.h"

namespace selfcal {

// Adds readings between those that there are, until the message has about this
// size.
inline MotionSegment Enlarged(MotionSegment segment, std::size_t bytes) {
  constexpr std::size_t kBytesOfReading = 56;
  const std::vector<ImuSample> given = segment.imu;
  const std::size_t between = std::max<std::size_t>(
      1, bytes / kBytesOfReading / std::max<std::size_t>(2, given.size()));
  segment.imu.clear();
  for (std::size_t k = 0; k + 1 < given.size(); ++k) {
    const ImuSample& a = given[k];
    const ImuSample& b = given[k + 1];
    for (std::size_t j = 0; j < between; ++j) {
      const double part = static_cast<double>(j) / static_cast<double>(between);
      ImuSample sample = a;
      sample.t_ns += static_cast<std::int64_t>(
          part * static_cast<double>(b.t_ns - a.t_ns));
      sample.gyro = (1 - part) * a.gyro + part * b.gyro;
      sample.accel = (1 - part) * a.accel + part * b.accel;
      segment.imu.push_back(sample);
    }
  }
  segment.imu.push_back(given.back());
  return segment;
}

}  // namespace selfcal
