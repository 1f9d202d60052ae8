// Dropped and repeated samples. A dropped sample appears as a step between
// timestamps that is a multiple of the usual one; a repeated one as six equal
// numbers, which do not occur twice for a sensor with noise, or as equal
// timestamps.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/factor/sampling.h"
#include "core/model/median.h"
#include "core/preflight/checks.h"

namespace selfcal {
namespace {

constexpr std::size_t kMinSamples = 100;
// Fraction of all samples: a smaller one is not a finding.
constexpr double kMinShare = 5e-3;
// A single gap of this length is a finding: the motion within it is unknown.
constexpr double kLongGap_s = 0.05;

struct Counts {
  std::size_t samples = 0;
  std::size_t missing = 0;
  std::size_t gaps = 0;
  std::size_t equal_readings = 0;
  std::size_t bad_stamps = 0;  // equal to the previous one, or earlier
  double longest_gap_s = 0;
};

std::int64_t MedianStep(std::span<const MotionSegment> segments) {
  std::vector<std::int64_t> steps;
  for (const MotionSegment& segment : segments) {
    const std::span<const ImuSample> imu = SamplesBetweenKeyframes(segment);
    for (std::size_t i = 1; i < imu.size(); ++i) {
      const std::int64_t step = imu[i].t_ns - imu[i - 1].t_ns;
      if (step > 0) steps.push_back(step);
    }
  }
  return UpperMedian(std::move(steps));
}

Counts Count(std::span<const MotionSegment> segments, double usual_ns) {
  Counts counts;
  for (const MotionSegment& segment : segments) {
    const std::span<const ImuSample> imu = SamplesBetweenKeyframes(segment);
    counts.samples += imu.size();
    for (std::size_t i = 1; i < imu.size(); ++i) {
      const ImuSample& a = imu[i - 1];
      const ImuSample& b = imu[i];
      const auto step = static_cast<double>(b.t_ns - a.t_ns);
      if (step <= 0) ++counts.bad_stamps;
      if (a.gyro == b.gyro && a.accel == b.accel) ++counts.equal_readings;
      if (step < kGapRatio * usual_ns) continue;
      ++counts.gaps;
      counts.missing += static_cast<std::size_t>(step / usual_ns - 0.4);
      counts.longest_gap_s = std::max(counts.longest_gap_s, 1e-9 * step);
    }
  }
  return counts;
}

std::string OfSamples(std::size_t part, std::size_t all) {
  return std::to_string(part) + " of " + std::to_string(all) + " samples (" +
         Figure(100 * static_cast<double>(part) / static_cast<double>(all)) +
         " %)";
}

}  // namespace

void CheckSampling(std::span<const MotionSegment> segments,
                   Diagnosis* diagnosis) {
  const auto usual_ns = static_cast<double>(MedianStep(segments));
  const Counts counts = Count(segments, usual_ns);
  if (counts.samples < kMinSamples || usual_ns <= 0) {
    diagnosis->not_checked.push_back("dropped and repeated samples: only " +
                                     std::to_string(counts.samples) +
                                     " samples");
    return;
  }
  const auto share = [&](std::size_t part) {
    return static_cast<double>(part) / static_cast<double>(counts.samples);
  };
  diagnosis->checked.push_back(
      "dropped and repeated samples: " + std::to_string(counts.samples) +
      " at " + Figure(1e9 / usual_ns) + " Hz");
  if (share(counts.missing) > kMinShare || counts.longest_gap_s > kLongGap_s) {
    diagnosis->findings.push_back(
        {FindingKind::kDroppedSamples,
         "samples of the IMU are missing: about " +
             OfSamples(counts.missing, counts.samples + counts.missing) +
             " in " + std::to_string(counts.gaps) +
             (counts.gaps == 1 ? " gap of " : " gaps of up to ") +
             Figure(1e3 * counts.longest_gap_s) + " ms, at one in " +
             Figure(1e-6 * usual_ns) + " ms",
         "look for a queue that overflows between the driver and the segment "
         "builder, and for messages sent without guarantee",
         static_cast<double>(counts.missing) /
             static_cast<double>(counts.samples + counts.missing)});
  }
  if (share(counts.equal_readings) > kMinShare) {
    diagnosis->findings.push_back(
        {FindingKind::kRepeatedSamples,
         "readings of the IMU are repeated: " +
             OfSamples(counts.equal_readings, counts.samples) +
             " equal the one before in all six numbers",
         "send each reading once, with the stamp at which it was taken; a "
         "driver that fills gaps with the last reading hides lost samples",
         share(counts.equal_readings)});
  }
  if (share(counts.bad_stamps) > kMinShare) {
    diagnosis->findings.push_back(
        {FindingKind::kRepeatedSamples,
         "timestamps of the IMU do not increase: those of " +
             OfSamples(counts.bad_stamps, counts.samples) +
             " are not later than the one before",
         "send each sample once, in the order of time",
         share(counts.bad_stamps)});
  }
}

}  // namespace selfcal
