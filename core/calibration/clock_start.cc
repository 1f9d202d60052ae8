#include "core/calibration/clock_start.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <span>
#include <utility>

#include "core/information/offset_start.h"
#include "core/model/median.h"
#include "core/model/temperature.h"
#include "core/preflight/time_offset.h"

namespace selfcal {
namespace {

// A time offset that a segment shows beyond that of theta, and when.
struct OffsetShift {
  double session_s;
  double shift_s;
};

// Shifts nearer to each other say nothing about a drift: they err by up to 2 ms
// (time_offset.h), and two quartz clocks drift by less than 2 ms in this time.
constexpr double kLeastApart_s = 30;

// Moves the time offsets of theta by the median of the shifts, and its time
// drifts, if that of every camera is estimated, by the median slope between any
// two.
void MoveClocks(const Rig& rig,
                const std::vector<OffsetShift>& shifts,
                Calibration* theta) {
  const bool drifts = IsEstimatedOfAllCameras(rig, "time_drift");
  std::vector<double> slopes;
  for (const OffsetShift& a : shifts) {
    for (const OffsetShift& b : shifts) {
      const double apart_s = b.session_s - a.session_s;
      if (!drifts || apart_s < kLeastApart_s) continue;
      slopes.push_back((b.shift_s - a.shift_s) / apart_s);
    }
  }
  const double drift = slopes.empty() ? 0 : UpperMedian(std::move(slopes));
  std::vector<double> offsets_s;
  for (const OffsetShift& at : shifts) {
    offsets_s.push_back(at.shift_s - drift * at.session_s);
  }
  const double offset_s = UpperMedian(std::move(offsets_s));
  for (CameraCalibration& camera : theta->cameras) {
    camera.time_offset_s += offset_s;
    if (drifts) *camera.time_drift += drift;
  }
}

}  // namespace

void StartAtOffsets(const Rig& rig,
                    Calibration* theta,
                    std::vector<const MotionSegment*>* segments,
                    std::vector<MotionSegment>* moved) {
  std::vector<OffsetShift> shifts;
  std::vector<const MotionSegment*> as_they_are;
  moved->reserve(segments->size());
  for (const MotionSegment*& segment : *segments) {
    std::optional<OffsetStart> start = FindOffsetStart(rig, *theta, *segment);
    if (!start) {
      as_they_are.push_back(segment);
      continue;
    }
    moved->push_back(std::move(start->segment));
    segment = &moved->back();
    shifts.push_back(
        {SessionTime(*segment, segment->keyframes.front()), start->shift_s});
  }
  if (shifts.empty()) return;
  const auto at_their_stamps =
      std::ranges::count_if(as_they_are, [&](const MotionSegment* segment) {
        const SegmentTheta theta_s(*theta, *segment);
        return EstimateTimeOffset(*theta_s, std::span(segment, 1)).has_value();
      });
  if (std::ssize(shifts) > at_their_stamps) MoveClocks(rig, shifts, theta);
}

}  // namespace selfcal
