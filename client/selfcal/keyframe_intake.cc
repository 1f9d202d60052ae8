#include "client/selfcal/keyframe_intake.h"

#include <algorithm>
#include <memory>

#include "client/selfcal/saturated_times.h"
#include "core/model/rig.h"

namespace selfcal::client {
namespace {

// Largest time between a state and its images.
constexpr std::uint64_t kMaxStateOffset_ns = 500'000'000;

}  // namespace

KeyframeIntake::KeyframeIntake(std::int64_t calibration_version) {
  estimation_.version = calibration_version;
}

void KeyframeIntake::SetCalibrationVersion(std::int64_t version) {
  estimation_.version = version;
}

bool KeyframeIntake::SetTheta(const Calibration& theta) {
  if (!Validate(theta, "").empty()) return false;
  estimation_.theta = std::make_shared<const Calibration>(theta);
  return true;
}

bool KeyframeIntake::SetHealthy(bool healthy) {
  if (healthy == healthy_) return false;
  healthy_ = healthy;
  if (healthy) StartNewIds();
  return true;
}

bool KeyframeIntake::IsInOrder(std::int64_t state_t_ns,
                               std::int64_t image_t_ns) const {
  const bool is_later = !last_ns_ || image_t_ns > *last_ns_;
  const std::uint64_t apart = Elapsed(std::max(state_t_ns, image_t_ns),
                                      std::min(state_t_ns, image_t_ns));
  return is_later && apart <= kMaxStateOffset_ns;
}

bool KeyframeIntake::IsAfterGap(std::int64_t image_t_ns,
                                std::uint64_t gap_ns) const {
  return last_ns_ && Elapsed(image_t_ns, *last_ns_) > gap_ns;
}

PendingKeyframe KeyframeIntake::Read(
    const KeyframeState& state,
    std::int64_t image_t_ns,
    std::span<const KeyframeObservation> observations) {
  PendingKeyframe keyframe{
      {state,
       filter_.Filter(observations, estimation_.theta.get()),
       state.t_ns - image_t_ns},
      estimation_};
  keyframe.observed.state.t_ns = image_t_ns;
  return keyframe;
}

}  // namespace selfcal::client
