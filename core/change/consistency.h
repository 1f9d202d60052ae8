// Tests whether segments are consistent with a calibration of known covariance,
// using only their SegmentInformation.
//
// If theta is the true value for both, then
//   delta = theta_segment [-] theta_active ~ N(0, Sigma_segment + Sigma_active)
// on the directions that the segment observes (for which it has more
// information than the prior of the rig), and
//   d = delta^T (Sigma_segment + Sigma_active)^-1 delta
// is chi-square distributed with as many degrees of freedom. Segments that
// share nothing are fused by adding their information.
//
// The information of a segment is linearised at the states of the SLAM system.
// If noise in these states looks like motion, the segment claims information
// that the motion does not provide: that theta is equal to the linearisation
// point. That is not evidence of a change. Therefore the segment is assumed to
// have an additional unknown error whose standard deviation, in each component,
// is twice its reach (the distance from the linearisation point to the active
// calibration). A segment that was linearised more than kMaxLinearisation
// reference sigmas away is not tested at all.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/change/theta_parts.h"
#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

inline constexpr double kMaxLinearisation = 1.0;  // reference sigmas
// A direction is observed, as everywhere, if the data has more information than
// the prior.
inline constexpr double kObserved = 1.0;

// A calibration with its uncertainty.
struct KnownCalibration {
  Calibration theta;
  Eigen::MatrixXd covariance;  // D x D, tangent at theta
  // Estimated from its segments (core/calibration/track_noise.h): the
  // covariance is that for a pixel sigma scaled by this factor.
  double track_noise_factor = 1;
};

struct ConsistencyTest {
  double statistic = 0;    // d
  int degrees = 0;         // 0: nothing is observed, and nothing was tested
  double probability = 1;  // of a d at least as large without a change
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
  // Largest standard deviation of the unknown error of a segment, by component;
  // empty: linearised at the active calibration.
  Eigen::VectorXd reach = {};

  OffsetInformation& operator+=(const OffsetInformation& other);
  // Does not change the reach.
  OffsetInformation& operator-=(const OffsetInformation& other);
};

// Tests against one calibration of one rig. `inflation` >= 1 is a factor on the
// variances of segments: scores assume that pixel errors are independent and as
// small as the rig states. The default is the square of the calibration's track
// noise factor. The covariance of the calibration already contains this factor,
// and is not scaled.
class ConsistencyTester {
 public:
  ConsistencyTester(const Rig& rig,
                    const KnownCalibration& active,
                    std::optional<double> inflation = std::nullopt);

  double inflation() const { return inflation_; }

  // Returns true if the segment can be tested: its information has the shape of
  // the rig, is finite, and was linearised near the active calibration, and not
  // too many of its observations were excluded.
  bool Accepts(const SegmentInformation& information) const;

  // Offset of an accepted segment.
  OffsetInformation Offset(const SegmentInformation& information) const;

  ConsistencyTest Test(const OffsetInformation& offset) const;
  // Tests each group, in the order of rig.groups, with all other components
  // unknown.
  std::vector<GroupConsistency> TestGroups(
      const OffsetInformation& offset) const;

  // The covariance of the active calibration is root root^T, of the free
  // components in units of the prior's sigmas.
  const Eigen::MatrixXd& root() const { return root_; }
  const std::vector<ThetaPart>& parts() const { return parts_; }
  // Parts for rig.groups, in their order.
  const std::vector<ThetaPart>& groups() const { return groups_; }

 private:
  // Covariance including the unknown error of segments.
  Eigen::MatrixXd Covariance(const OffsetInformation& offset) const;

  const Calibration theta_;
  const double inflation_;
  const std::vector<int> free_;
  const Eigen::VectorXd prior_;      // sigmas of the free components
  const Eigen::VectorXd reference_;  // sigmas of the free components
  Eigen::MatrixXd Sigma_;            // of the free components, in prior units
  Eigen::MatrixXd root_;             // of Sigma_
  const std::vector<ThetaPart> parts_;
  const std::vector<ThetaPart> groups_;
};

}  // namespace selfcal
