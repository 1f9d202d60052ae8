#include "core/coach/primitives.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>

#include "core/model/so3.h"
#include "core/simulation/random.h"

namespace selfcal {
namespace {

using enum Coordinate;

constexpr std::uint64_t kPersonStream = 201;
constexpr double kTwoPi = 2 * std::numbers::pi;
constexpr double kQuarterTurn = std::numbers::pi / 2;
constexpr double kPoseRate_hz = 50;

// Deviation of a person from the instruction.
constexpr double kPaceError = 0.1;
constexpr double kSizeError = 0.15;
// Slow movement of the moving hand, on each axis.
constexpr double kWaver_m = 0.01;
constexpr double kWaver_rad = 0.03;
constexpr double kSlowestWaver_hz = 0.3;
constexpr double kFastestWaver_hz = 0.9;

std::vector<Primitive> MakePrimitives() {
  return {
      {.name = "hold_still",
       .instruction = "Hold the device still, or put it down.",
       .swings = {},
       .unrest = 0.05},
      {.name = "pan",
       .instruction = "Turn the device left and right about the vertical, 30 "
                      "degrees to each side, not quite once a second.",
       .swings = {{kYaw, 0.4, 0.7}}},
      {.name = "nod",
       .instruction = "Nod with the device: turn it up and down, 30 degrees "
                      "each way, not quite once a second.",
       .swings = {{kPitch, 0.4, 0.7}}},
      {.name = "roll",
       .instruction = "Turn the device about its viewing direction, like a "
                      "steering wheel, 30 degrees to each side, not quite "
                      "once a second.",
       .swings = {{kRoll, 0.4, 0.7}}},
      {.name = "thrust",
       .instruction = "Shake the device forward and back along its viewing "
                      "direction, a hand's breadth, three times in two "
                      "seconds.",
       .swings = {{kForward, 0.06, 1.5}}},
      {.name = "sway",
       .instruction = "Shake the device left and right, a hand's breadth, "
                      "three times in two seconds, without turning it.",
       .swings = {{kLeft, 0.06, 1.5}}},
      {.name = "bounce",
       .instruction = "Shake the device up and down, a hand's breadth, three "
                      "times in two seconds, without turning it.",
       .swings = {{kUp, 0.06, 1.5}}},
      {.name = "figure_eight",
       .instruction = "Trace a sideways figure eight, half a metre wide, and "
                      "lean the device into its curves, two seconds each.",
       .swings = {{kLeft, 0.25, 0.5},
                  {kUp, 0.12, 1.0},
                  {kRoll, 0.5, 0.5, kQuarterTurn}}},
      {.name = "orbit",
       .instruction = "Carry the device in an arc to and fro around an object "
                      "one metre ahead, and keep looking at it.",
       .swings = {{kYaw, 0.6, 0.35}, {kPitch, 0.2, 0.5}},
       .pivot_m = 1},
      {.name = "walk",
       .instruction = "Walk straight ahead with the device, looking ahead.",
       .swings = {{kUp, 0.02, 1.9}, {kLeft, 0.02, 0.95}, {kPitch, 0.02, 1.9}},
       .forward_mps = 1.2},
      {.name = "lay_on_sides",
       .instruction = "Turn the device slowly onto its left side, through "
                      "upright to its right side, and back.",
       .swings = {{kRoll, 1.45, 0.2}}},
      {.name = "ceiling_and_floor",
       .instruction = "Point the device slowly at the ceiling, then at the "
                      "floor, and back.",
       .swings = {{kPitch, 1.2, 0.22}}},
      {.name = "lay_and_shake",
       .instruction = "Turn the device slowly from one side onto the other "
                      "and shake it at the same time, forward, back and "
                      "sideways.",
       .swings = {{kRoll, 1.3, 0.2},
                  {kForward, 0.05, 1.4},
                  {kLeft, 0.05, 1.15}}},
      {.name = "tumble",
       .instruction = "Turn the device about all its axes as far as your wrist "
                      "allows, and move it in all directions at the same time.",
       .swings = {{kRoll, 0.8, 0.23},
                  {kPitch, 0.6, 0.29},
                  {kYaw, 0.6, 0.26},
                  {kForward, 0.08, 0.9},
                  {kLeft, 0.08, 0.77},
                  {kUp, 0.08, 1.03}}},
  };
}

// Rotation from the body to forward, left, up of the first camera.
Eigen::Quaterniond DeviceFromBody(const Calibration& theta) {
  Eigen::Matrix3d R_CD;
  R_CD << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  return Eigen::Quaterniond(R_CD).conjugate() * theta.cameras.front().q_CI;
}

// One performance of a motion by one person.
class Performance {
 public:
  Performance(const Primitive& primitive,
              const Calibration& theta,
              std::uint64_t seed)
      : q_DI_(DeviceFromBody(theta)),
        forward_mps_(primitive.forward_mps),
        pivot_m_(primitive.pivot_m) {
    Random random(seed, kPersonStream);
    heading_rad_ = random.Uniform(0, kTwoPi);
    const double pace = 1 + random.Uniform(-kPaceError, kPaceError);
    const double begin_s = random.Uniform(0, 5);
    for (PrimitiveSwing swing : primitive.swings) {
      swing.frequency_hz *= pace;
      swing.amplitude *= 1 + random.Uniform(-kSizeError, kSizeError);
      swing.phase_rad += kTwoPi * swing.frequency_hz * begin_s;
      swings_.push_back(swing);
    }
    for (int i = 0; i < kCoordinates; ++i) {
      const auto coordinate = static_cast<Coordinate>(i);
      const double waver = coordinate < kRoll ? kWaver_m : kWaver_rad;
      const double hz = random.Uniform(kSlowestWaver_hz, kFastestWaver_hz);
      swings_.push_back({coordinate,
                         primitive.unrest * waver,
                         hz,
                         random.Uniform(0, kTwoPi)});
    }
  }

  TimedPose At(double t_s) const {
    std::array<double, kCoordinates> at = {};
    at[static_cast<int>(kForward)] = forward_mps_ * t_s;
    for (const PrimitiveSwing& swing : swings_) {
      at[static_cast<int>(swing.coordinate)] +=
          swing.amplitude *
          std::sin(kTwoPi * swing.frequency_hz * t_s + swing.phase_rad);
    }
    const Eigen::Quaterniond q_heading = Exp({0, 0, heading_rad_});
    const Eigen::Quaterniond q_turn =
        Exp({0, 0, at[5]}) * Exp({0, at[4], 0}) * Exp({at[3], 0, 0});
    const Eigen::Vector3d pivot(pivot_m_, 0, 0);
    TimedPose pose;
    pose.t_s = t_s;
    pose.q_GI = (q_heading * q_turn * q_DI_).normalized();
    pose.p_GI = Eigen::Vector3d(0, 0, 1.5) +
                q_heading * (Eigen::Vector3d(at[0], at[1], at[2]) + pivot -
                             q_turn * pivot);
    return pose;
  }

 private:
  const Eigen::Quaterniond q_DI_;
  const double forward_mps_;
  const double pivot_m_;
  double heading_rad_ = 0;
  std::vector<PrimitiveSwing> swings_;
};

}  // namespace

std::span<const Primitive> Primitives() {
  static const std::vector<Primitive> all = MakePrimitives();
  return all;
}

const Primitive* FindPrimitive(std::string_view name) {
  const auto all = Primitives();
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const Primitive& primitive) {
        return primitive.name == name;
      });
  return found == all.end() ? nullptr : &*found;
}

std::unique_ptr<Trajectory> Perform(const Primitive& primitive,
                                    const Calibration& theta,
                                    double duration_s,
                                    std::uint64_t seed) {
  const Performance performance(primitive, theta, seed);
  std::vector<TimedPose> poses;
  const int steps = static_cast<int>(std::ceil(duration_s * kPoseRate_hz));
  for (int i = 0; i <= steps; ++i) {
    poses.push_back(performance.At(i / kPoseRate_hz));
  }
  // MakeSpline() cannot reject any of these poses.
  std::unique_ptr<Trajectory> trajectory = MakeSpline(poses);
  assert(trajectory != nullptr);
  return trajectory;
}

}  // namespace selfcal
