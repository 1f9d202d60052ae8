// A keyframe that the builder holds, and the calibration behind its state.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>

#include "client/selfcal/closed_segment.h"
#include "core/model/calibration.h"

namespace selfcal::client {

// The calibration with which the SLAM system estimated a state.
struct Estimation {
  std::int64_t version = 1;
  std::shared_ptr<const Calibration> theta;  // null if it is not known
};

// A keyframe that is in no complete segment yet.
struct PendingKeyframe {
  ObservedKeyframe observed;
  Estimation estimation;

  std::int64_t t_ns() const { return observed.state.t_ns; }
  // The first and the last time about which the samples matter to it.
  std::int64_t begin_ns() const {
    return t_ns() + std::min<std::int64_t>(observed.state_offset_ns, 0);
  }
  std::int64_t end_ns() const {
    return t_ns() + std::max<std::int64_t>(observed.state_offset_ns, 0);
  }
};

}  // namespace selfcal::client
