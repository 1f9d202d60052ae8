// Is what segments say consistent with a calibration that is known to a
// covariance? From their SegmentInformation alone.
//
// If theta is the truth of both, then
//   delta = theta_segment [-] theta_active ~ N(0, Sigma_segment + Sigma_active)
// on the directions that the segment observes (of which it says more than the
// prior of the rig), and d = delta^T (Sigma_segment + Sigma_active)^-1 delta is
// chi-square distributed with as many degrees of freedom. Segments that share
// nothing are fused by adding their information.
//
// The information of a segment is linear. It is used where the calibration at
// which it was linearised is near the active one: within kMaxLinearisation
// reference sigmas in every component. (Simulated with the SLAM system's states
// as they are, d has the stated distribution up to there; at twice that its
// mean is 1.2 times the degrees.)
//
// Pure, deterministic, any thread.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

inline constexpr double kMaxLinearisation = 2.0;  // reference sigmas

// A calibration and how well it is known.
struct KnownCalibration {
  Calibration theta;
  Eigen::MatrixXd covariance;  // D x D, tangent at theta
  // As its segments showed it (core/calibration/track_noise.h): the covariance
  // is that with a pixel sigma so many times larger than the rig's.
  double track_noise_factor = 1;
};

struct ConsistencyTest {
  double statistic = 0;    // d
  int degrees = 0;         // 0: nothing is observed, and nothing was tested
  double probability = 1;  // of a d as large or larger without a change
};

struct GroupConsistency {
  std::string group;
  ConsistencyTest test;  // of its parameters, all others marginalised
};

// The information of one or more segments about theta [-] theta_active: free
// components, in units of the rig's prior sigmas.
struct OffsetInformation {
  Eigen::MatrixXd Lambda;
  Eigen::VectorXd eta;

  OffsetInformation& operator+=(const OffsetInformation& other);
  OffsetInformation& operator-=(const OffsetInformation& other);
};

// Tests against one calibration of one rig. `inflation` >= 1 is a factor on the
// variances of segments: scores take pixel errors for independent and as small
// as the rig says. Without it, it is the square of the calibration's track
// noise factor. The covariance of the calibration holds that already, and is
// taken as it is.
class ConsistencyTester {
 public:
  ConsistencyTester(const Rig& rig,
                    const KnownCalibration& active,
                    std::optional<double> inflation = std::nullopt);

  double inflation() const { return inflation_; }

  // Whether the segment can be tested: its information has the shape of the
  // rig, is finite, and was linearised near the active calibration, and not
  // too many of its observations were left out.
  bool Accepts(const SegmentInformation& information) const;

  // Of a segment that is accepted.
  OffsetInformation Offset(const SegmentInformation& information) const;

  ConsistencyTest Test(const OffsetInformation& offset) const;
  // In the order of rig.groups.
  std::vector<GroupConsistency> TestGroups(
      const OffsetInformation& offset) const;

 private:
  struct Group {
    std::string name;
    std::vector<int> at;  // among the free components
  };

  const Calibration theta_;
  const double inflation_;
  const std::vector<int> free_;
  const Eigen::VectorXd prior_;      // sigmas of the free components
  const Eigen::VectorXd reference_;  // sigmas of the free components
  Eigen::MatrixXd Sigma_;            // of the free components, in prior units
  std::vector<Group> groups_;
};

}  // namespace selfcal
