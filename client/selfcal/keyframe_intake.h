// Which keyframes the builder accepts from the SLAM system, and what it adds to
// them: the calibration behind their states, with the observations filtered.
//
// Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "client/selfcal/closed_segment.h"
#include "client/selfcal/observation_filter.h"
#include "client/selfcal/pending_keyframe.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal::client {

class KeyframeIntake {
 public:
  explicit KeyframeIntake(std::int64_t calibration_version);

  // The calibration of the states from the next keyframe on. SetTheta returns
  // false and ignores one that is not valid; it throws std::bad_alloc.
  void SetCalibrationVersion(std::int64_t version);
  bool SetTheta(const Calibration& theta);

  // Returns true if this changes the health of the SLAM system. Once it is
  // healthy again, ids are those of new landmarks.
  bool SetHealthy(bool healthy);
  bool healthy() const { return healthy_; }

  // True if a keyframe is later than the last accepted one, with a state near
  // its images.
  bool IsInOrder(std::int64_t state_t_ns, std::int64_t image_t_ns) const;
  // True if a keyframe is more than this time after the last accepted one.
  bool IsAfterGap(std::int64_t image_t_ns, std::uint64_t gap_ns) const;

  // The ids of landmarks that come from now on denote others.
  void StartNewIds() { filter_.StartNewIds(); }
  // Throws std::bad_alloc.
  PendingKeyframe Read(const KeyframeState& state,
                       std::int64_t image_t_ns,
                       std::span<const KeyframeObservation> observations);
  void SetAccepted(std::int64_t image_t_ns) { last_ns_ = image_t_ns; }

  std::uint64_t observations_dropped() const { return filter_.dropped(); }

 private:
  Estimation estimation_;
  bool healthy_ = true;
  ObservationFilter filter_;
  std::optional<std::int64_t> last_ns_;  // timestamp accepted last
};

}  // namespace selfcal::client
