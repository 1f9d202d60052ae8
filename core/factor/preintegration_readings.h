// The steps of one interval of IMU samples. Internal to core/factor.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <span>

#include "core/model/segment.h"

namespace selfcal::preintegration {

constexpr double kSecondsPerNanosecond = 1e-9;

inline ImuSample Interpolate(std::span<const ImuSample> samples,
                             std::int64_t t_ns) {
  const auto after = std::upper_bound(
      samples.begin(),
      samples.end(),
      t_ns,
      [](std::int64_t t, const ImuSample& s) { return t < s.t_ns; });
  if (after == samples.begin()) return samples.front();
  const ImuSample& a = *(after - 1);
  if (after == samples.end()) return a;
  const ImuSample& b = *after;
  const double part =
      static_cast<double>(t_ns - a.t_ns) / static_cast<double>(b.t_ns - a.t_ns);
  return {t_ns,
          a.gyro + part * (b.gyro - a.gyro),
          a.accel + part * (b.accel - a.accel)};
}

// Calls visit(sample, h) at the beginning of the interval with h = 0, and at
// the end of each step with its length [s], which is not zero.
template <class Visitor>
void VisitReadings(std::span<const ImuSample> samples,
                   std::int64_t t0_ns,
                   std::int64_t t1_ns,
                   const Visitor& visit) {
  assert(!samples.empty() && t0_ns <= t1_ns);
  visit(Interpolate(samples, t0_ns), 0.0);
  std::int64_t t_ns = t0_ns;
  const auto advance = [&](std::int64_t next_ns, const ImuSample& sample) {
    visit(sample, static_cast<double>(next_ns - t_ns) * kSecondsPerNanosecond);
    t_ns = next_ns;
  };
  // Only samples strictly inside: no step has length zero.
  auto it = std::upper_bound(
      samples.begin(),
      samples.end(),
      t0_ns,
      [](std::int64_t t, const ImuSample& s) { return t < s.t_ns; });
  for (; it != samples.end() && it->t_ns < t1_ns; ++it) advance(it->t_ns, *it);
  if (t1_ns > t_ns) advance(t1_ns, Interpolate(samples, t1_ns));
}

}  // namespace selfcal::preintegration
