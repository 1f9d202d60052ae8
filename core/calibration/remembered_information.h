// The information about theta of segments without data, in addition to that of
// the segments on which a calibration is based.
//
// All segments are joined at their ends (session_chain.h), and the joint
// information of those of the calibration is subtracted from that of all:
//   Lambda(remembered) = Lambda(all) - Lambda(of the calibration),
// and eta likewise. Data only adds information, so that the difference is
// semidefinite. It contains the information of a remembered segment about
// theta, and its information through the states of a neighbour that is part of
// the calibration: no information is counted twice, and the sum of both is the
// linearisation of a calibration on all of the data. Each observation belongs
// to one segment; a landmark that several segments observe is a separate
// landmark of each.
//
// Pure functions, callable from any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/information/fusion.h"
#include "core/information/segment_ends.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// One of all segments; `ends` must outlive the call.
struct JoinedSegment {
  const SegmentEnds* ends = nullptr;
  // True if the calibration has the data of the segment. Its ends should then
  // be linearised at the point, which the data makes possible.
  bool calibrated_on = false;
  // Its residuals over their expectation (ResidualStatistics::fit): its noise
  // is treated as this many times larger. At most 1: as expected, or not
  // measured.
  double fit = 1;
  // Time of reception, for the walk between sessions.
  std::int64_t time_ns = 0;
};

struct RememberedOptions {
  // Densities (D) of a random walk of theta [tangent units / sqrt(s)], by which
  // information older than the newest segment decreases. Empty: theta is
  // constant.
  Eigen::VectorXd walk = {};
  // Noise scale that the calibration found, relative to the rig's stated noise.
  double noise_scale = 1;
  // Groups of parameters that have changed before, and may continue to.
  std::vector<std::string> changing = {};
};

// A segment that was linearised further than this from the point, rms over the
// free components in reference sigmas, is excluded.
inline constexpr double kMaxReach = 2.0;
bool IsTooFar(const Rig& rig,
              const SegmentEnds& ends,
              const Calibration& point);

struct RememberedInformation {
  ThetaInformation information;  // about theta [-] point
  int segments = 0;              // without data, that contribute
  int left_out = 0;              // excluded: linearised too far away
  double reach = 0;              // the largest of those that contribute
};

// Weight of the k-th segment (from 1) that was linearised at this distance from
// the point [reference sigmas, rms]. The error of a linearisation is quadratic
// in the reach, and the same for all segments, so that it does not average out
// in their sum: k segments are worth k / (1 + 0.015 k reach^4) segments.
// (Measured: 20 simulated segments have a NEES of 1.33 of its expectation at a
// reach of 1, and of 2.65 at 1.7.) The weight is the share of the last segment.
double ReachWeight(int k, double reach);

// Segments are in the order of time, with those of a session consecutive. The
// caller excludes segments that contradict the others.
RememberedInformation InformationOfRemembered(
    const Rig& rig,
    const Calibration& point,
    std::span<const JoinedSegment> segments,
    const RememberedOptions& options = {});

// Information about theta [-] point of all segments, whether or not the
// calibration has their data; those that were linearised too far away are
// excluded.
ThetaInformation InformationOfAll(const Rig& rig,
                                  const Calibration& point,
                                  std::span<const JoinedSegment> segments,
                                  const RememberedOptions& options = {});

}  // namespace selfcal
