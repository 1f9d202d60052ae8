// Clocks of cameras and IMU that drift apart while the calibration has a
// constant offset: the offset at which the rates of the gyroscope fit the
// rotations of the keyframes, segment by segment, is a line over the time since
// the session began.
#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "core/preflight/checks.h"
#include "core/preflight/time_offset.h"

namespace selfcal {
namespace {

constexpr std::size_t kMinSegments = 3;
// Over a shorter time, clocks do not drift apart far enough to do harm.
constexpr double kMinSpan_s = 60;
constexpr double kDriftSigmas = 6;

struct OffsetAtTime {
  double session_s;
  double offset_s;
};

struct Drift {
  double value = 0;  // [s/s]
  double sigma = 0;  // by the scatter about the line
};

Drift FitDrift(const std::vector<OffsetAtTime>& offsets) {
  const auto count = static_cast<double>(offsets.size());
  OffsetAtTime mean = {};
  for (const OffsetAtTime& at : offsets) {
    mean.session_s += at.session_s / count;
    mean.offset_s += at.offset_s / count;
  }
  double square = 0, product = 0;
  for (const OffsetAtTime& at : offsets) {
    const double t = at.session_s - mean.session_s;
    square += t * t;
    product += t * (at.offset_s - mean.offset_s);
  }
  const double drift = product / square;
  double scatter = 0;
  for (const OffsetAtTime& at : offsets) {
    const double residual =
        at.offset_s - mean.offset_s - drift * (at.session_s - mean.session_s);
    scatter += residual * residual;
  }
  return {drift, std::sqrt(scatter / (count - 2) / square)};
}

using Segments = std::vector<const MotionSegment*>;

double SessionTimeOf(const MotionSegment* segment) {
  return SessionTime(*segment, segment->keyframes.front());
}

// The time between the earliest and the latest segment of their sessions.
double Span(const Segments& segments) {
  if (segments.empty()) return 0;
  const auto [first, last] =
      std::ranges::minmax(segments, std::less<>(), SessionTimeOf);
  return SessionTimeOf(last) - SessionTimeOf(first);
}

std::string PerSecond(double drift) { return Figure(1e6 * drift) + " us"; }

}  // namespace

void CheckClocks(const Calibration& theta,
                 std::span<const MotionSegment> segments,
                 Diagnosis* diagnosis) {
  if (HasTimeDrift(theta)) return;
  Segments dated, turning;
  for (const MotionSegment& segment : segments) {
    if (segment.session_start_ns && !segment.keyframes.empty()) {
      dated.push_back(&segment);
    }
  }
  if (Span(dated) < kMinSpan_s) return;
  std::vector<OffsetAtTime> offsets;
  for (const MotionSegment* segment : dated) {
    const auto found = EstimateTimeOffset(theta, std::span(segment, 1));
    if (!found) continue;
    turning.push_back(segment);
    offsets.push_back({SessionTimeOf(segment), found->offset_s});
  }
  const double span_s = Span(turning);
  if (offsets.size() < kMinSegments || span_s < kMinSpan_s) {
    diagnosis->not_checked.push_back(
        "drift of the clocks: the device hardly turns in all but " +
        std::to_string(offsets.size()) + " segments");
    return;
  }
  const Drift drift = FitDrift(offsets);
  diagnosis->checked.push_back(
      "drift of the clocks: " + std::to_string(offsets.size()) +
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
