// Kinds of rendered recordings on which the tracker is measured.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "client/tracking/feature_tracker.h"
#include "core/model/calibration.h"
#include "test/rendering/rendered_recording.h"

namespace selfcal {

struct RecordingKind {
  std::string name;
  Rig rig;
  RenderOptions render;
  client::TrackerOptions tracker;
  double excitation = 1;
  // The calibration that the tracker is given.
  std::function<Calibration(const Calibration&)> start =
      [](const Calibration& truth) { return truth; };
};

// Two cameras of 640 x 480 px beside each other, 11 cm apart, with lenses like
// those of EuRoC.
Rig StereoPairRig();

std::vector<RecordingKind> RecordingKinds();

RecordingKind KindNamed(const std::string& name);

RenderedRecording Render(const RecordingKind& kind,
                         double seconds,
                         std::uint64_t seed);

}  // namespace selfcal
