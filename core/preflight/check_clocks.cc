// Clocks of cameras and IMU that drift apart while the calibration has a
// constant offset: the offset at which the rates of the gyroscope fit the
// rotations of the keyframes, segment by segment, is a line over the time since
// the session began. A SLAM system that takes over another version may know
// another offset from there on: the lines of the versions have a slope in
// common, and each a height of its own.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/preflight/checks.h"
#include "core/preflight/time_offset.h"

namespace selfcal {
namespace {

// Over a shorter time, clocks do not drift apart far enough to do harm.
constexpr double kMinSpan_s = 60;
constexpr double kDriftSigmas = 6;

struct OffsetAtTime {
  double session_s;
  double offset_s;
};

// The offsets of the segments of each version.
using Offsets = std::map<std::int64_t, std::vector<OffsetAtTime>>;

struct Drift {
  double value = 0;  // [s/s]
  double sigma = 0;  // by the scatter about the lines
};

std::size_t CountOf(const Offsets& offsets) {
  std::size_t count = 0;
  for (const auto& [version, of] : offsets) count += of.size();
  return count;
}

// Offsets beyond those that the slope and the heights need.
int Redundancy(const Offsets& offsets) {
  return static_cast<int>(CountOf(offsets)) - static_cast<int>(offsets.size()) -
         1;
}

// The same without the mean of each version.
std::vector<OffsetAtTime> AboutTheirMeans(const Offsets& offsets) {
  std::vector<OffsetAtTime> about;
  for (const auto& [version, of] : offsets) {
    const auto count = static_cast<double>(of.size());
    OffsetAtTime mean = {};
    for (const OffsetAtTime& at : of) {
      mean.session_s += at.session_s / count;
      mean.offset_s += at.offset_s / count;
    }
    for (const OffsetAtTime& at : of) {
      about.push_back(
          {at.session_s - mean.session_s, at.offset_s - mean.offset_s});
    }
  }
  return about;
}

// Needs a positive redundancy.
Drift FitDrift(const Offsets& offsets) {
  const std::vector<OffsetAtTime> about = AboutTheirMeans(offsets);
  double square = 0, product = 0;
  for (const auto& [t, offset_s] : about) {
    square += t * t;
    product += t * offset_s;
  }
  const double drift = product / square;
  double scatter = 0;
  for (const auto& [t, offset_s] : about) {
    const double residual = offset_s - drift * t;
    scatter += residual * residual;
  }
  return {drift, std::sqrt(scatter / Redundancy(offsets) / square)};
}

double SessionTimeOf(const MotionSegment* segment) {
  return SessionTime(*segment, segment->keyframes.front());
}

// The longest time between the earliest and the latest segment of a version in
// their sessions.
double Span(const Offsets& offsets) {
  double span_s = 0;
  for (const auto& [version, of] : offsets) {
    const auto [first, last] =
        std::ranges::minmax(of, std::less<>(), &OffsetAtTime::session_s);
    span_s = std::max(span_s, last.session_s - first.session_s);
  }
  return span_s;
}

std::string PerSecond(double drift) { return Figure(1e6 * drift) + " us"; }

}  // namespace

void CheckClocks(const Calibration& theta,
                 std::span<const MotionSegment> segments,
                 Diagnosis* diagnosis) {
  if (HasTimeDrift(theta)) return;
  std::vector<const MotionSegment*> dated;
  Offsets times, offsets;
  for (const MotionSegment& segment : segments) {
    if (!segment.session_start_ns || segment.keyframes.empty()) continue;
    dated.push_back(&segment);
    times[segment.calibration_version].push_back({SessionTimeOf(&segment), 0});
  }
  if (Span(times) < kMinSpan_s) return;
  for (const MotionSegment* segment : dated) {
    const auto found = EstimateTimeOffset(theta, std::span(segment, 1));
    if (!found) continue;
    offsets[segment->calibration_version].push_back(
        {SessionTimeOf(segment), found->offset_s});
  }
  const std::string count = std::to_string(CountOf(offsets));
  const double span_s = Span(offsets);
  if (Redundancy(offsets) < 1 || span_s < kMinSpan_s) {
    diagnosis->not_checked.push_back(
        "drift of the clocks: the device turns in too few segments of each "
        "version (" +
        count + " in all)");
    return;
  }
  const Drift drift = FitDrift(offsets);
  diagnosis->checked.push_back("drift of the clocks: " + count +
                               " segments over " + Figure(span_s) + " s");
  if (!(std::abs(drift.value) > kDriftSigmas * drift.sigma) ||
      std::abs(drift.value) * span_s < kLeastTimeOffset_s) {
    return;
  }
  diagnosis->findings.push_back(
      {FindingKind::kClockDrift,
       "the clocks of cameras and IMU drift apart by " +
           PerSecond(drift.value) + " each second (sigma " +
           PerSecond(drift.sigma) + "), " +
           Figure(1e3 * std::abs(drift.value) * span_s) +
           " ms over the time of the segments",
       "create the rig with the blocks *.time_offset and *.time_drift "
       "estimated, and set the clocks when a session begins; or synchronise "
       "them",
       drift.value});
}

}  // namespace selfcal
