// What the builder keeps of the observations of a keyframe: those inside the
// image, with ids of landmarks that are unique within the session.
//
// Not thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "client/selfcal/closed_segment.h"
#include "core/model/calibration.h"

namespace selfcal::client {

class ObservationFilter {
 public:
  // The ids that come from now on are those of other landmarks, although they
  // may equal earlier ones.
  void StartNewIds() { ++id_epoch_; }

  // Returns the observations with a finite pixel that lie inside the image of
  // their camera, or as little outside as the daemon permits
  // (Limits::pixel_margin_px). theta is null if it is not known: then any
  // finite pixel is inside. Observations by cameras that theta does not have
  // are kept: the daemon names them. Throws std::bad_alloc.
  std::vector<KeyframeObservation> Filter(
      std::span<const KeyframeObservation> observations,
      const Calibration* theta);

  std::uint64_t dropped() const { return dropped_; }  // by all calls

 private:
  std::uint64_t id_epoch_ = 0;
  std::uint64_t dropped_ = 0;
};

}  // namespace selfcal::client
