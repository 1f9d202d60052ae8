// The steps of one interval of IMU samples. Internal to core/factor.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/model/segment.h"

namespace selfcal::preintegration {

constexpr double kSecondsPerNanosecond = 1e-9;

// A second difference over steps that differ by more than this factor is mostly
// noise: samples are missing there.
constexpr double kMaxStepRatio = 2;

// Corrected sample i for an integration that assumes linear readings between
// samples.
//
// A signal w, sampled every h, differs from its linear interpolation by -h^2/12
// w'' on average. Subtracting this from the samples first makes the integral
// one of fourth order; otherwise sensors that measure sines of 2 Hz at 200 Hz
// seem to have a scale error of 3e-4. The second derivative is that of the
// parabola through the neighbours; at the first and the last sample, that of
// the adjacent one. The mean over many samples does not change, nor does noise
// at low frequencies.
inline ImuSample ReadingForLines(std::span<const ImuSample> samples,
                                 std::size_t i) {
  ImuSample reading = samples[i];
  if (samples.size() < 3) return reading;
  const std::size_t middle = std::clamp<std::size_t>(i, 1, samples.size() - 2);
  const ImuSample& a = samples[middle - 1];
  const ImuSample& b = samples[middle];
  const ImuSample& c = samples[middle + 1];
  const auto h0 = static_cast<double>(b.t_ns - a.t_ns);
  const auto h1 = static_cast<double>(c.t_ns - b.t_ns);
  if (h0 > kMaxStepRatio * h1 || h1 > kMaxStepRatio * h0) return reading;
  // (h0^3 + h1^3) / 12 w'' of both steps, divided by their length h0 + h1.
  const double part = (h0 * h0 - h0 * h1 + h1 * h1) / (6 * (h0 + h1));
  const double to_c = part / h1;
  const double to_a = part / h0;
  reading.gyro -= to_c * (c.gyro - b.gyro) + to_a * (a.gyro - b.gyro);
  reading.accel -= to_c * (c.accel - b.accel) + to_a * (a.accel - b.accel);
  return reading;
}

// The reading at t_ns; sample `next` is the first at or after it. Beyond the
// first and the last sample their readings are held constant.
inline ImuSample Interpolate(std::span<const ImuSample> samples,
                             std::size_t next,
                             std::int64_t t_ns) {
  if (next == samples.size()) return ReadingForLines(samples, next - 1);
  const ImuSample b = ReadingForLines(samples, next);
  if (b.t_ns == t_ns || next == 0) return b;
  const ImuSample a = ReadingForLines(samples, next - 1);
  const double part =
      static_cast<double>(t_ns - a.t_ns) / static_cast<double>(b.t_ns - a.t_ns);
  return {t_ns,
          a.gyro + part * (b.gyro - a.gyro),
          a.accel + part * (b.accel - a.accel)};
}

// Calls visit(sample, h, next) at the beginning of the interval with h = 0, and
// at the end of each step with its length [s], which is not zero; `next` is the
// first sample at or after it.
template <class Visitor>
void VisitReadings(std::span<const ImuSample> samples,
                   std::int64_t t0_ns,
                   std::int64_t t1_ns,
                   const Visitor& visit) {
  assert(!samples.empty() && t0_ns <= t1_ns);
  auto i = static_cast<std::size_t>(
      std::lower_bound(
          samples.begin(),
          samples.end(),
          t0_ns,
          [](const ImuSample& s, std::int64_t t) { return s.t_ns < t; }) -
      samples.begin());
  visit(Interpolate(samples, i, t0_ns), 0.0, i);
  std::int64_t t_ns = t0_ns;
  const auto advance = [&](std::int64_t next_ns, const ImuSample& sample) {
    visit(
        sample, static_cast<double>(next_ns - t_ns) * kSecondsPerNanosecond, i);
    t_ns = next_ns;
  };
  // Only samples strictly inside: no step may have length zero.
  if (i < samples.size() && samples[i].t_ns == t0_ns) ++i;
  for (; i < samples.size() && samples[i].t_ns < t1_ns; ++i) {
    advance(samples[i].t_ns, ReadingForLines(samples, i));
  }
  if (t1_ns > t_ns) advance(t1_ns, Interpolate(samples, i, t1_ns));
}

}  // namespace selfcal::preintegration
