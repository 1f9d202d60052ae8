// Validation of a motion segment, with one function for each part.
#include <algorithm>
#include <cmath>
#include <compare>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/image_bounds.h"
#include "core/model/segment.h"
#include "core/model/temperature.h"
#include "core/model/too_many.h"
#include "core/model/violation_list.h"

namespace selfcal {
namespace {

constexpr std::size_t kMaxSessionLength = 128;
// Limit of about 126 years in either direction: sums and differences cannot
// overflow.
constexpr std::int64_t kMaxTime_ns = 4'000'000'000'000'000'000;

bool TimeInRange(std::int64_t t_ns) {
  return t_ns >= -kMaxTime_ns && t_ns <= kMaxTime_ns;
}

// later - earlier in seconds, exact before the division for times in range.
double Seconds(std::int64_t earlier_ns, std::int64_t later_ns) {
  return static_cast<double>(static_cast<std::uint64_t>(later_ns) -
                             static_cast<std::uint64_t>(earlier_ns)) *
         1e-9;
}

void CheckKey(const MotionSegment& segment, ViolationList* list) {
  const std::string& session = segment.key.session;
  if (session.empty()) {
    list->Add("key.session", "is empty; name the session");
  } else if (session.size() > kMaxSessionLength) {
    list->Add("key.session",
              "has " + std::to_string(session.size()) +
                  " characters; at most " + std::to_string(kMaxSessionLength) +
                  " are allowed");
  } else if (std::any_of(session.begin(), session.end(), [](char c) {
               return c < ' ' || c > '~';
             })) {
    list->Add("key.session", "has a character that is not printable ASCII");
  }
  if (segment.key.index < 0) {
    list->Add("key.index", std::to_string(segment.key.index) + " is negative");
  }
  if (segment.calibration_version < 1) {
    list->Add("calibration_version",
              std::to_string(segment.calibration_version) +
                  " is not a version; versions begin with 1");
  }
}

void CheckTemperature(const MotionSegment& segment,
                      const Calibration& theta,
                      ViolationList* list) {
  if (!segment.temperature_c) {
    if (HasSlopes(theta)) {
      list->Add("temperature_c",
                "is missing, and the rig has slopes with temperature; send the "
                "temperature of the sensors in degrees Celsius");
    }
    return;
  }
  std::string fault = TemperatureFault(theta, *segment.temperature_c);
  if (!fault.empty()) list->Add("temperature_c", std::move(fault));
}

// A session has lasted too long where the clocks are further apart than a
// constant offset may be.
void CheckClocks(const Calibration& theta,
                 double session_s,
                 const SegmentLimits& limits,
                 ViolationList* list) {
  for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
    if (!theta.cameras[j].time_drift) continue;
    const double apart_s = TimeOffsetAt(theta.cameras[j], session_s);
    if (std::abs(apart_s) <= limits.max_clock_offset_s) continue;
    list->Add("session_start_ns",
              "is so long ago that the clock of cam" + std::to_string(j) +
                  " is off by " + std::to_string(apart_s) +
                  " s; begin a new session when the clocks are set");
  }
}

void CheckSessionStart(const MotionSegment& segment,
                       const Calibration& theta,
                       const SegmentLimits& limits,
                       ViolationList* list) {
  const auto add = [&](std::string message) {
    list->Add("session_start_ns", std::move(message));
  };
  if (!segment.session_start_ns) {
    if (HasTimeDrift(theta)) {
      add("is missing, and the rig has cameras with a time drift; send the "
          "time at which the session began, the same for all of its segments");
    }
    return;
  }
  // Differences to a time in range do not overflow.
  const std::int64_t start_ns = *segment.session_start_ns;
  if (!TimeInRange(start_ns)) {
    add(std::to_string(start_ns) + " ns is out of range");
    return;
  }
  if (segment.keyframes.empty()) return;
  const std::int64_t first_ns = segment.keyframes.front().t_ns;
  if (!TimeInRange(first_ns)) return;
  if (first_ns < start_ns) {
    add("is later than the first keyframe");
    return;
  }
  const double session_s = Seconds(start_ns, first_ns);
  if (session_s > limits.max_session_s) {
    add("is " + std::to_string(session_s) +
        " s before the first keyframe; begin a new session when the clocks are "
        "set");
    return;
  }
  CheckClocks(theta, session_s, limits, list);
}

// Adds a violation and returns false if the list must not be inspected.
bool CheckCount(std::string_view field,
                std::size_t count,
                int min_count,
                int max_count,
                ViolationList* list) {
  if (count > static_cast<std::size_t>(std::max(max_count, 0))) {
    list->Add(std::string(field),
              TooMany(count, static_cast<std::size_t>(std::max(max_count, 0))));
    return false;
  }
  if (count < static_cast<std::size_t>(std::max(min_count, 0))) {
    list->Add(std::string(field),
              "has " + std::to_string(count) + " elements; at least " +
                  std::to_string(min_count) + " are needed");
  }
  return true;
}

void AddIf(std::string_view list_name,
           std::size_t index,
           std::string_view member,
           std::string fault,
           ViolationList* list) {
  if (fault.empty()) return;
  list->Add(ElementPath(list_name, index, member), std::move(fault));
}

// Describes the fault of the time of element i, relative to the previous one.
template <class Timed>
std::string TimeFault(const std::vector<Timed>& elements,
                      std::size_t i,
                      double max_gap_s) {
  const std::int64_t t_ns = elements[i].t_ns;
  if (!TimeInRange(t_ns)) {
    return std::to_string(t_ns) + " ns is out of range";
  }
  if (i == 0 || !TimeInRange(elements[i - 1].t_ns)) return {};
  const std::int64_t before_ns = elements[i - 1].t_ns;
  if (t_ns <= before_ns) {
    return std::to_string(t_ns) + " ns is not after the previous " +
           std::to_string(before_ns) + " ns; sort by time";
  }
  const double gap_s = Seconds(before_ns, t_ns);
  if (gap_s <= max_gap_s) return {};
  return "is " + Readable(gap_s) + " s after the previous; at most " +
         Readable(max_gap_s) + " s are allowed";
}

void CheckKeyframes(const MotionSegment& segment,
                    const SegmentLimits& limits,
                    ViolationList* list) {
  const std::vector<KeyframeState>& keyframes = segment.keyframes;
  constexpr std::string_view kName = "keyframes";
  for (std::size_t i = 0; i < keyframes.size() && !list->cut(); ++i) {
    const KeyframeState& x = keyframes[i];
    AddIf(kName,
          i,
          "t_ns",
          TimeFault(keyframes, i, limits.max_keyframe_gap_s),
          list);
    AddIf(kName,
          i,
          "q_GI",
          QuaternionFault(x.q_GI, limits.quaternion_norm_tolerance),
          list);
    AddIf(kName,
          i,
          "p_GI",
          VectorFault(x.p_GI, limits.max_position_m, "m"),
          list);
    AddIf(kName,
          i,
          "v_GI",
          VectorFault(x.v_GI, limits.max_speed_mps, "m/s"),
          list);
    AddIf(kName,
          i,
          "b_a",
          VectorFault(x.b_a, limits.max_accel_mps2, "m/s^2"),
          list);
    AddIf(kName,
          i,
          "b_g",
          VectorFault(x.b_g, limits.max_gyro_radps, "rad/s"),
          list);
  }
}

void CheckReadings(std::string_view name,
                   const std::vector<ImuSample>& imu,
                   const SegmentLimits& limits,
                   ViolationList* list) {
  for (std::size_t i = 0; i < imu.size() && !list->cut(); ++i) {
    AddIf(name, i, "t_ns", TimeFault(imu, i, limits.max_imu_gap_s), list);
    AddIf(name,
          i,
          "gyro",
          VectorFault(imu[i].gyro, limits.max_gyro_radps, "rad/s"),
          list);
    AddIf(name,
          i,
          "accel",
          VectorFault(imu[i].accel, limits.max_accel_mps2, "m/s^2"),
          list);
  }
}

// The samples must cover all keyframes, and not extend far beyond them.
void CheckImuCover(std::string_view name,
                   const std::vector<ImuSample>& imu,
                   const MotionSegment& segment,
                   const SegmentLimits& limits,
                   ViolationList* list) {
  if (segment.keyframes.empty() || imu.empty()) return;
  const std::int64_t begin_ns = segment.keyframes.front().t_ns;
  const std::int64_t end_ns = segment.keyframes.back().t_ns;
  const std::int64_t first_ns = imu.front().t_ns;
  const std::int64_t last_ns = imu.back().t_ns;
  if (first_ns > begin_ns) {
    list->Add(ElementPath(name, 0, "t_ns"),
              std::to_string(first_ns) +
                  " ns is after the first keyframe; send the samples from " +
                  std::to_string(begin_ns) + " ns on");
  }
  const std::string last = ElementPath(name, imu.size() - 1, "t_ns");
  if (last_ns < end_ns) {
    list->Add(last,
              std::to_string(last_ns) +
                  " ns is before the last keyframe; send the samples up to " +
                  std::to_string(end_ns) + " ns");
  } else if (TimeInRange(last_ns) && TimeInRange(end_ns) &&
             Seconds(end_ns, last_ns) > limits.max_keyframe_gap_s) {
    list->Add(last,
              "is " + Readable(Seconds(end_ns, last_ns)) +
                  " s after the last keyframe; at most " +
                  Readable(limits.max_keyframe_gap_s) + " s are allowed");
  }
}

void CheckImu(std::string_view name,
              const std::vector<ImuSample>& imu,
              const MotionSegment& segment,
              const SegmentLimits& limits,
              ViolationList* list) {
  constexpr int kMinImuSamples = 2;
  if (!CheckCount(std::string(name),
                  imu.size(),
                  kMinImuSamples,
                  limits.max_imu_samples,
                  list)) {
    return;
  }
  CheckReadings(name, imu, limits, list);
  CheckImuCover(name, imu, segment, limits, list);
}

// Returns for each key the index of the first equal key before it, or -1.
template <class Key>
std::vector<std::int64_t> EarlierEquals(const std::vector<Key>& keys) {
  std::vector<std::int64_t> earlier(keys.size(), -1);
  const bool ascend =
      std::adjacent_find(keys.begin(), keys.end(), std::greater_equal<>()) ==
      keys.end();
  if (ascend) return earlier;  // as in most segments
  std::vector<std::int64_t> order(keys.size());
  for (std::size_t i = 0; i < keys.size(); ++i) {
    order[i] = static_cast<std::int64_t>(i);
  }
  std::sort(order.begin(), order.end(), [&](std::int64_t a, std::int64_t b) {
    return keys[a] < keys[b] || (keys[a] == keys[b] && a < b);
  });
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (keys[order[i]] != keys[order[i - 1]]) continue;
    const std::int64_t before = earlier[order[i - 1]];
    earlier[order[i]] = before >= 0 ? before : order[i - 1];
  }
  return earlier;
}

void CheckLandmarks(const MotionSegment& segment,
                    const SegmentLimits& limits,
                    ViolationList* list) {
  if (list->cut()) return;
  const std::vector<Landmark>& landmarks = segment.landmarks;
  std::vector<std::uint64_t> ids;
  ids.reserve(landmarks.size());
  for (const Landmark& landmark : landmarks) ids.push_back(landmark.id);
  const std::vector<std::int64_t> earlier = EarlierEquals(ids);
  for (std::size_t i = 0; i < landmarks.size() && !list->cut(); ++i) {
    if (earlier[i] >= 0) {
      list->Add(ElementPath("landmarks", i, "id"),
                std::to_string(ids[i]) + " is also the id of " +
                    ElementPath("landmarks", earlier[i], ""));
    }
    AddIf("landmarks",
          i,
          "p_G",
          VectorFault(landmarks[i].p_G, limits.max_position_m, "m"),
          list);
  }
}

// Describes the fault of an index into `count` elements called `what`.
std::string IndexFault(std::int32_t index,
                       std::size_t count,
                       std::string_view what) {
  if (index >= 0 && static_cast<std::size_t>(index) < count) return {};
  return std::to_string(index) + " is not among the " + std::to_string(count) +
         " " + std::string(what);
}

std::string PixelFault(const Eigen::Vector2d& z_px,
                       const CameraCalibration& camera,
                       double margin_px) {
  if (!z_px.allFinite()) return "is not finite";
  if (IsInImage(camera, z_px, margin_px)) return {};
  return "(" + Readable(z_px.x()) + ", " + Readable(z_px.y()) +
         ") is outside the image of " + std::to_string(camera.width_px) +
         " x " + std::to_string(camera.height_px) + " px";
}

void CheckObservations(const MotionSegment& segment,
                       const Calibration& theta,
                       const SegmentLimits& limits,
                       ViolationList* list) {
  if (list->cut()) return;
  struct Key {
    std::int32_t keyframe, camera, landmark;
    auto operator<=>(const Key&) const = default;
  };
  constexpr std::string_view kName = "observations";
  const std::vector<Observation>& observations = segment.observations;
  std::vector<Key> keys;
  keys.reserve(observations.size());
  for (const Observation& o : observations) {
    keys.push_back({o.keyframe, o.camera, o.landmark});
  }
  const std::vector<std::int64_t> earlier = EarlierEquals(keys);
  for (std::size_t i = 0; i < observations.size() && !list->cut(); ++i) {
    const Observation& o = observations[i];
    if (earlier[i] >= 0) {
      list->Add(ElementPath(kName, i, ""),
                "has the keyframe, camera and landmark of " +
                    ElementPath(kName, earlier[i], ""));
    }
    AddIf(kName,
          i,
          "keyframe",
          IndexFault(
              o.keyframe, segment.keyframes.size(), "keyframes of the segment"),
          list);
    const std::string camera_fault =
        IndexFault(o.camera, theta.cameras.size(), "cameras of the rig");
    AddIf(kName, i, "camera", camera_fault, list);
    AddIf(kName,
          i,
          "landmark",
          IndexFault(
              o.landmark, segment.landmarks.size(), "landmarks of the segment"),
          list);
    if (!camera_fault.empty()) {
      if (!o.z_px.allFinite()) AddIf(kName, i, "z_px", "is not finite", list);
      continue;
    }
    AddIf(kName,
          i,
          "z_px",
          PixelFault(o.z_px, theta.cameras[o.camera], limits.pixel_margin_px),
          list);
  }
}

}  // namespace

std::vector<Violation> Validate(const MotionSegment& segment,
                                const Calibration& theta,
                                const SegmentLimits& limits) {
  ViolationList list(limits.max_violations);
  CheckKey(segment, &list);
  CheckTemperature(segment, theta, &list);
  CheckSessionStart(segment, theta, limits, &list);
  const bool keyframes_counted = CheckCount("keyframes",
                                            segment.keyframes.size(),
                                            limits.min_keyframes,
                                            limits.max_keyframes,
                                            &list);
  if (keyframes_counted) CheckKeyframes(segment, limits, &list);
  CheckImu("imu", segment.imu, segment, limits, &list);
  if (theta.imu1) {
    CheckImu("imu1", segment.imu1, segment, limits, &list);
  } else if (!segment.imu1.empty()) {
    list.Add("imu1",
             "has " + std::to_string(segment.imu1.size()) +
                 " samples, but the rig has no second IMU; send none");
  }
  if (CheckCount("landmarks",
                 segment.landmarks.size(),
                 0,
                 limits.max_landmarks,
                 &list)) {
    CheckLandmarks(segment, limits, &list);
  }
  if (CheckCount("observations",
                 segment.observations.size(),
                 0,
                 limits.max_observations,
                 &list)) {
    CheckObservations(segment, theta, limits, &list);
  }
  return list.Take();
}

}  // namespace selfcal
