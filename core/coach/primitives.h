// Motions that can be described to a person in a sentence, for a device in the
// hand, and the corresponding trajectories.
//
// They are described relative to the device: forward is the viewing direction
// of its first camera, up is up in that camera's image, wherever the IMU is
// mounted. Pure, deterministic, callable from any thread.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "core/model/calibration.h"
#include "core/simulation/trajectory.h"

namespace selfcal {

// Translations along forward, left and up [m], rotations about forward (roll),
// left (pitch, positive is down) and up (yaw) [rad].
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
  std::string_view name;         // [a-z_]+, constant across releases
  std::string_view instruction;  // a sentence or two for the person
  std::vector<PrimitiveSwing> swings;
  double forward_mps = 0;  // walking speed
  double pivot_m = 0;      // rotates about a point at this distance ahead
  double unrest = 1;  // motion of the hand relative to that of a moving person
};

// All primitives; the first is holding still, which has the lowest gain. None
// rotates or accelerates more (rms, within 10 %) than MakeHandheld does at
// excitation 1.
std::span<const Primitive> Primitives();

// Returns null if there is no primitive of that name.
const Primitive* FindPrimitive(std::string_view name);

// The motion as a person performs it with a device of this calibration (at
// least one camera): speed and size vary by about 10 %, and the hand moves
// about all axes, differently each time. duration_s > 0.1.
std::unique_ptr<Trajectory> Perform(const Primitive& primitive,
                                    const Calibration& theta,
                                    double duration_s,
                                    std::uint64_t seed);

}  // namespace selfcal
