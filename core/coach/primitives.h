// Motions that a person can be asked for in a sentence, with a device in hand,
// and what they look like as trajectories.
//
// They are described from the device: forward is where its first camera looks,
// up is up in that camera's image, wherever the IMU sits. Pure, deterministic,
// any thread.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "core/model/calibration.h"
#include "core/simulation/trajectory.h"

namespace selfcal {

// Moves along forward, left and up [m], turns about forward (roll), left
// (pitch, down is positive) and up (yaw) [rad].
enum class Coordinate { kForward, kLeft, kUp, kRoll, kPitch, kYaw };
inline constexpr int kCoordinates = 6;

// amplitude sin(2 pi frequency t + phase) of one coordinate.
struct PrimitiveSwing {
  Coordinate coordinate;
  double amplitude;  // [m] or [rad]
  double frequency_hz;
  double phase_rad = 0;
};

struct Primitive {
  std::string_view name;         // [a-z_]+, stays the same over releases
  std::string_view instruction;  // a sentence or two for the person
  std::vector<PrimitiveSwing> swings;
  double forward_mps = 0;  // walks
  double pivot_m = 0;      // turns about a point so far ahead
  double unrest = 1;       // of the hand, against that of a moving person
};

// All of them; the first is to hold still, which teaches least. None turns or
// accelerates more (rms, within 10 %) than MakeHandheld does at excitation 1.
std::span<const Primitive> Primitives();

// Null if there is none of that name.
const Primitive* FindPrimitive(std::string_view name);

// As a person performs it with a device of this calibration (at least one
// camera): pace and size are off by some 10 % and the hand wavers about all
// axes, each time in another way. duration_s > 0.1.
std::unique_ptr<Trajectory> Perform(const Primitive& primitive,
                                    const Calibration& theta,
                                    double duration_s,
                                    std::uint64_t seed);

}  // namespace selfcal
