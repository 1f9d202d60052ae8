// What the benchmark works on: segments of a simulated hand-held device, whose
// SLAM system runs with a factory's calibration.
#pragma once

#include <string>
#include <vector>

#include "core/information/inliers.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

struct SceneOptions {
  int segments = 1;
  int every = 1;  // of so many segments of the session, one is used
  int keyframes = 40;
  int landmarks_in_view = 130;
  // Keyframes; and of new tracks, landmarks that were seen before.
  int max_track_length = 1'000'000;
  double revisit_fraction = 0.1;
  // Readout of a rolling shutter, whose line delay is estimated; 0: a global
  // one.
  double readout_s = 0;
};

struct Scene {
  Rig rig;  // its factory calibration is where segments are scored
  std::vector<MotionSegment> segments;
};

// With the defaults, one segment of 40 keyframes, about 400 landmarks, about
// 5,000 observations and 4 s of IMU at 200 Hz; 26 components of theta are
// estimated.
Scene MakeScene(const SceneOptions& options = {});

// Size of the first segment, in one line.
std::string Describe(const Scene& scene);

// The inliers and landmarks that the score of a segment stands on.
InlierSelection Select(const Scene& scene, const MotionSegment& segment);

}  // namespace selfcal
