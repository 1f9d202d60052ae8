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
// The information of a segment is linear, and taken at the states of the SLAM
// system. Where noise in these looks like motion, it claims to know what the
// motion does not show: that theta is where it was linearised. That is no
// evidence for a change. So the distance from there to the active calibration
// makes an unknown error of the segment, of a standard deviation twice as large
// in each component: its reach. A segment from over kMaxLinearisation reference
// sigmas away is not tested at all.
//
// Pure, deterministic, any thread.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/change/parameter_blocks.h"
#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

inline constexpr double kMaxLinearisation = 1.0;  // reference sigmas

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
  // By component, of the one that reaches furthest; empty: linearised at the
  // active calibration.
  Eigen::VectorXd reach = {};

  OffsetInformation& operator+=(const OffsetInformation& other);
  // Keeps the reach.
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
  // In the order of rig.groups, each with all others unknown.
  std::vector<GroupConsistency> TestGroups(
      const OffsetInformation& offset) const;

  // The covariance of the active calibration is root root^T, of the free
  // components in units of the prior's sigmas.
  const Eigen::MatrixXd& root() const { return root_; }
  const std::vector<ParameterBlock>& blocks() const { return blocks_; }
  // Of rig.groups, in their order.
  const std::vector<ParameterBlock>& groups() const { return groups_; }

 private:
  // With the reach of segments.
  Eigen::MatrixXd Covariance(const OffsetInformation& offset) const;

  const Calibration theta_;
  const double inflation_;
  const std::vector<int> free_;
  const Eigen::VectorXd prior_;      // sigmas of the free components
  const Eigen::VectorXd reference_;  // sigmas of the free components
  Eigen::MatrixXd Sigma_;            // of the free components, in prior units
  Eigen::MatrixXd root_;             // of Sigma_
  const std::vector<ParameterBlock> blocks_;
  const std::vector<ParameterBlock> groups_;
};

}  // namespace selfcal
