// The steps of one interval of IMU samples. Internal to core/factor.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <span>

#include "core/model/segment.h"

namespace selfcal::preintegration {

constexpr double kSecondsPerNanosecond = 1e-9;

// The reading at t_ns, which is not after *next, the first sample at or after
// it. Beyond the first and the last sample their readings are held.
inline ImuSample Interpolate(std::span<const ImuSample> samples,
                             std::span<const ImuSample>::iterator next,
                             std::int64_t t_ns) {
  if (next == samples.end()) return samples.back();
  const ImuSample& b = *next;
  if (b.t_ns == t_ns || next == samples.begin()) return b;
  const ImuSample& a = *(next - 1);
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
  auto it = std::lower_bound(
      samples.begin(),
      samples.end(),
      t0_ns,
      [](const ImuSample& s, std::int64_t t) { return s.t_ns < t; });
  visit(Interpolate(samples, it, t0_ns), 0.0);
  std::int64_t t_ns = t0_ns;
  const auto advance = [&](std::int64_t next_ns, const ImuSample& sample) {
    visit(sample, static_cast<double>(next_ns - t_ns) * kSecondsPerNanosecond);
    t_ns = next_ns;
  };
  // Only samples strictly inside: no step has length zero.
  if (it != samples.end() && it->t_ns == t0_ns) ++it;
  for (; it != samples.end() && it->t_ns < t1_ns; ++it) advance(it->t_ns, *it);
  if (t1_ns > t_ns) advance(t1_ns, Interpolate(samples, it, t1_ns));
}

}  // namespace selfcal::preintegration
