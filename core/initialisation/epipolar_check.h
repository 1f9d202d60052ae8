// Finds the matches of points between two views that agree with one motion of
// the camera, of which the rotation is known approximately.
//
// Rays a and b of a point, in the frames A and B of the two views, and the
// direction t of the origin of A in B lie in one plane, t . (R_BA a x b) = 0.
// Two matches determine t (RANSAC); afterwards t and a small correction of the
// rotation, which absorbs errors of the calibration, are fitted to all inliers.
// Pure functions, callable from any thread; the same input gives the same bits.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

namespace selfcal {

struct RayPair {
  Eigen::Vector3d a;  // unit, in A
  Eigen::Vector3d b;  // unit, in B
};

struct EpipolarOptions {
  double px_per_rad = 400;
  // Distance of b from the epipolar plane of an inlier: at most this, or 3.5
  // robust standard deviations of all matches if that is more, as with a wrong
  // calibration.
  double max_distance_px = 1.0;
  // The same before the rotation is corrected, relative to the rotation's own
  // flow, in addition.
  double flow_share = 0.03;
  double rotation_sigma_rad = 0.03;  // of the given rotation
  int iterations = 150;
  std::uint64_t seed = 1;
};

struct EpipolarFit {
  std::vector<char> inliers;  // one for each pair
  Eigen::Quaterniond q_BA;    // corrected
  Eigen::Vector3d t_B;        // unit: the direction of the origin of A in B
};

// Below this number of pairs nothing can be checked.
inline constexpr int kMinEpipolarPairs = 8;

// Fits the motion of the camera to the pairs, from q_BA, and from a given
// direction t_B if that is known. Without enough pairs, all are inliers.
EpipolarFit CheckEpipolar(
    const std::vector<RayPair>& pairs,
    const Eigen::Quaterniond& q_BA,
    const EpipolarOptions& options,
    const std::optional<Eigen::Vector3d>& t_B = std::nullopt);

}  // namespace selfcal
