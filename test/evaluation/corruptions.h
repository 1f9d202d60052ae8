// What goes wrong in the segments of real devices, as pure functions: each
// returns the segment as a broken SLAM system or sensor would have handed it
// over. The key, the version and whatever is not named stay as they are, and a
// valid segment stays valid, so that nothing but its content gives it away.
#pragma once

#include <cstdint>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

// Keyframes stamped this much too late (too early where negative): their
// images, states and landmarks stay what they are. Keyframes that IMU samples
// do not cover any more are left out, with what only they saw.
MotionSegment ShiftStamps(const MotionSegment& segment, double late_s);

// Observations of camera 0 as those of camera 1 and the other way round, as
// where two cables were exchanged; pixels beyond the other image are left out.
MotionSegment SwapCameras(const MotionSegment& segment,
                          const Calibration& theta);

// Part of the landmarks moves along together, as a crowd or a vehicle in view:
// `truth` is the same segment without errors (SimulatedSession::truth), whose
// pixels tell by how much each measured one moves. Each landmark is at its
// place in the first keyframe that sees it.
struct SceneMotion {
  double part = 0.5;  // of the landmarks
  double speed_mps = 0.5;
};
MotionSegment MoveScene(const MotionSegment& segment,
                        const MotionSegment& truth,
                        const Calibration& theta_true,
                        const SceneMotion& motion,
                        std::uint64_t seed);

// Positions, velocities and landmarks as if the world were so many times as
// large.
MotionSegment LoseScale(const MotionSegment& segment, double factor);

// One reading of the gyroscope, in the middle of the segment and on one axis
// that the seed draws, replaced by this value [rad/s].
MotionSegment CorruptGyroSample(const MotionSegment& segment,
                                double value_radps,
                                std::uint64_t seed);

// The segments of a session whose filter has diverged: the states walk away
// from where they should be, in metres and tens of degrees over a minute, and
// what each landmark was triangulated with walks with them. Biases and
// velocities are wild.
struct Divergence {
  double rotation_rad = 0.1;  // of a random walk, after one second
  double position_m = 0.5;
  double velocity_mps = 1;  // standard deviation
  double accel_bias_mps2 = 0.5;
  double gyro_bias_radps = 0.1;
};
std::vector<MotionSegment> Diverge(const std::vector<MotionSegment>& session,
                                   const Divergence& divergence,
                                   std::uint64_t seed);

}  // namespace selfcal
