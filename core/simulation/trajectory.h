// Motion of a body: pose and its derivatives at any time, smooth enough for an
// IMU (continuous acceleration).
//
// Trajectories are immutable: any thread may evaluate them. The factories are
// deterministic: the same arguments give the same bits.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace selfcal {

// Kinematics at one instant.
struct BodyMotion {
  Eigen::Quaterniond q_GI;
  Eigen::Vector3d p_GI;  // [m]
  Eigen::Vector3d v_GI;  // [m/s], in G
  Eigen::Vector3d a_GI;  // [m/s^2], in G, gravity not included
  Eigen::Vector3d w_I;   // [rad/s], in I
  Eigen::Vector3d dw_I;  // [rad/s^2], the derivative of w_I
};

class Trajectory {
 public:
  virtual ~Trajectory() = default;
  virtual double duration_s() const = 0;
  // Requires 0 <= t_s <= duration_s(). The derivatives are the analytic ones of
  // the returned pose.
  virtual BodyMotion At(double t_s) const = 0;
};

// A body that does not move, slightly tilted.
std::unique_ptr<Trajectory> MakeRest(double duration_s);

// Hand-held in a room of 8 x 6 x 4 m: sums of sines in all six degrees of
// freedom, with phases and frequencies from the seed, added to a slow walk
// through the room. `excitation` 1 is vigorous (several m/s^2, 1 to 3 rad/s),
// 0.1 calm, 0 at rest.
std::unique_ptr<Trajectory> MakeHandheld(double duration_s,
                                         double excitation,
                                         std::uint64_t seed);

// Alternating calm and excited phases (excitation 0.05 and 1) of 8 to 15 s,
// joined smoothly; starts with 5 s of rest.
std::unique_ptr<Trajectory> MakeMixed(double duration_s, std::uint64_t seed);

// The body rotates about a pivot, such as a wrist or the head of a tripod, and
// translates only as this rotation requires.
struct RotationInPlaceOptions {
  // The pivot in the frame of the body [m]: zero if the IMU is at the pivot.
  Eigen::Vector3d pivot_I = Eigen::Vector3d::Zero();
  // Standard deviation of the pivot's own motion on each axis, at 0.3 to 2 Hz:
  // no hand keeps a point at rest. 0: the pivot is at rest.
  double pivot_jitter_m = 3e-3;
  // Excitation of the rotation: 1 is vigorous (1 to 3 rad/s), 0 at rest.
  double excitation = 1;
};
std::unique_ptr<Trajectory> MakeRotationInPlace(
    double duration_s,
    const RotationInPlaceOptions& options,
    std::uint64_t seed);

// A pose with its time, as in a line of a TUM file.
struct TimedPose {
  double t_s = 0;
  Eigen::Quaterniond q_GI = Eigen::Quaterniond::Identity();  // unit
  Eigen::Vector3d p_GI = Eigen::Vector3d::Zero();            // [m]
};

struct SplineOptions {
  // Motion faster than about 1 / (2 spacing) is smoothed, and with it the noise
  // of single poses. Position has wider knots: the IMU measures its second
  // derivative, but only the first of rotation.
  double position_knots_s = 0.1;
  double rotation_knots_s = 0.06;
  // Longest interval without a pose that may be bridged, by the motion of least
  // jerk. Motion capture systems typically lose tracking for about 1 s.
  double max_gap_s = 1.5;
};

// Fits a quintic B-spline to poses, for position and rotation alike, by least
// squares: all derivatives of BodyMotion are continuous, and so are the next
// two. Time is relative to the first pose. Returns null, with the reason in
// *error unless that is null, for fewer than 4 poses, values that are not
// finite, times that do not increase, a gap, or a rotation of more than 150
// degrees from one pose to the next.
std::unique_ptr<Trajectory> MakeSpline(const std::vector<TimedPose>& poses,
                                       const SplineOptions& options = {},
                                       std::string* error = nullptr);

// Parses the poses of a TUM file's text ("t tx ty tz qx qy qz qw" a line, '#'
// comments). Quaternions are normalised if their norm is within 1 % of one. On
// a malformed line it returns false and describes the line in *error, counting
// from 1.
bool ParseTum(const std::string& text,
              std::vector<TimedPose>* poses,
              std::string* error);

}  // namespace selfcal
