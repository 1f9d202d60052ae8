// A session of any length, as a SLAM system gives it keyframe by keyframe: the
// motion repeats itself after a while, so that little has to be simulated.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "client/selfcal/segment_builder.h"
#include "core/model/rig.h"

namespace selfcal::client {

// Simulates one loop of 400 keyframes at 10 Hz. Motion and IMU of one loop
// follow on those of the loop before without a jump, apart from the walk of the
// biases; the landmarks of each loop are new ones.
class LoopedSession {
 public:
  static constexpr int kLoopKeyframes = 400;

  // The SLAM system runs with the factory's calibration; the truth is theta.
  LoopedSession(const Rig& rig, const Calibration& theta);

  // What comes with keyframe k: the samples up to it, the keyframe, and at the
  // end of a loop the samples that are left of it.
  struct Step {
    std::vector<ImuSample> before;
    KeyframeState state;
    std::vector<KeyframeObservation> observations;
    std::vector<ImuSample> after;
  };
  // To be called for k = 0, 1, ...
  Step Next(int k);
  // The same, into the builder.
  void Feed(int k, SegmentBuilder* builder);

 private:
  std::vector<ImuSample> imu_;
  std::vector<KeyframeState> keyframes_;
  std::vector<std::vector<KeyframeObservation>> observations_;
  std::uint64_t landmarks_ = 0;
  std::size_t next_sample_ = 0;  // of this loop
};

}  // namespace selfcal::client
