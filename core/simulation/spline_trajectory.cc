// B-splines of position and quaternion: the position directly, the quaternion
// normalised, q(t) = x / |x|, from which exactly
//   q' = (x' - q (q . x')) / |x|,   w_I = 2 vec(q^-1 q'),
//   w_I' = 2 vec(q^-1 q'') = 2 (vec(q^-1 x'') - (q . x') w_I) / |x|.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "core/simulation/bspline.h"
#include "core/simulation/trajectory.h"

namespace selfcal {
namespace {

// Beyond it the direction of rotation between two poses is ambiguous.
constexpr double kMaxTurn_rad = 150 * std::numbers::pi / 180;

// Returns the reason why a pose cannot follow the previous one; empty if it
// can.
std::string CheckStep(const TimedPose& last,
                      const TimedPose& pose,
                      double max_gap_s) {
  const double dt_s = pose.t_s - last.t_s;
  if (!(dt_s > 0)) return "is not later than the one before";
  if (dt_s > max_gap_s) return fmt::format("follows a gap of {:.3f} s", dt_s);
  if (pose.q_GI.angularDistance(last.q_GI) > kMaxTurn_rad) {
    return "turns by more than 150 degrees";
  }
  return {};
}

// Returns the reason why the poses cannot be fitted; empty if they can.
std::string CheckPoses(const std::vector<TimedPose>& poses,
                       const SplineOptions& options) {
  if (!(options.position_knots_s > 0) || !(options.rotation_knots_s > 0)) {
    return "the distance between knots must be positive";
  }
  if (poses.size() < 4) {
    return fmt::format("{} poses; a spline needs at least 4", poses.size());
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const TimedPose& pose = poses[i];
    std::string problem;
    if (!std::isfinite(pose.t_s) || !pose.p_GI.allFinite()) {
      problem = "is not finite";
    } else if (!(std::abs(pose.q_GI.norm() - 1) < 1e-3)) {
      problem = "has no unit quaternion";
    } else if (i > 0) {
      problem = CheckStep(poses[i - 1], pose, options.max_gap_s);
    }
    if (!problem.empty()) {
      return fmt::format("pose {} at {} s {}", i, pose.t_s, problem);
    }
  }
  return {};
}

class SplineTrajectory : public Trajectory {
 public:
  SplineTrajectory(const std::vector<double>& times_s,
                   const Eigen::MatrixXd& positions,
                   const Eigen::MatrixXd& quaternions,
                   const SplineOptions& options)
      : duration_s_(times_s.back()),
        position_(times_s, positions, duration_s_, options.position_knots_s),
        rotation_(times_s, quaternions, duration_s_, options.rotation_knots_s) {
  }

  double duration_s() const override { return duration_s_; }

  BodyMotion At(double t_s) const override {
    const BSpline::Sample p = position_.At(t_s);
    const BSpline::Sample x = rotation_.At(t_s);
    const double norm = x.x.norm();
    const Eigen::Vector4d q = x.x / norm;
    const Eigen::Vector4d d1 = x.d1;
    const Eigen::Quaterniond q_dot(
        Eigen::Vector4d((d1 - q * q.dot(d1)) / norm));
    BodyMotion motion;
    motion.q_GI = Eigen::Quaterniond(q);
    motion.p_GI = p.x;
    motion.v_GI = p.d1;
    motion.a_GI = p.d2;
    motion.w_I = 2 * (motion.q_GI.conjugate() * q_dot).vec();
    const Eigen::Quaterniond second(Eigen::Vector4d(x.d2));
    motion.dw_I =
        2 *
        ((motion.q_GI.conjugate() * second).vec() - q.dot(d1) * motion.w_I) /
        norm;
    return motion;
  }

 private:
  double duration_s_;
  BSpline position_;  // [m]
  BSpline rotation_;  // quaternion (x, y, z, w), not normalised
};

}  // namespace

std::unique_ptr<Trajectory> MakeSpline(const std::vector<TimedPose>& poses,
                                       const SplineOptions& options,
                                       std::string* error) {
  const std::string problem = CheckPoses(poses, options);
  if (!problem.empty()) {
    if (error != nullptr) *error = problem;
    return nullptr;
  }
  const auto count = static_cast<Eigen::Index>(poses.size());
  std::vector<double> times_s;
  Eigen::MatrixXd positions(count, 3);
  Eigen::MatrixXd quaternions(count, 4);
  Eigen::Vector4d last = poses.front().q_GI.coeffs();
  for (Eigen::Index i = 0; i < count; ++i) {
    const TimedPose& pose = poses[static_cast<std::size_t>(i)];
    times_s.push_back(pose.t_s - poses.front().t_s);
    positions.row(i) = pose.p_GI.transpose();
    // q and -q are the same rotation: choose the sign of the previous one.
    if (pose.q_GI.coeffs().dot(last) < 0) {
      last = -pose.q_GI.coeffs();
    } else {
      last = pose.q_GI.coeffs();
    }
    quaternions.row(i) = last.transpose();
  }
  return std::make_unique<SplineTrajectory>(
      times_s, positions, quaternions, options);
}

}  // namespace selfcal
