// What segments without data say about theta beside those that a calibration
// stands on.
//
// All segments are joined at their ends (session_chain.h), and from what they
// say together is taken what those of the calibration say among themselves:
//   Lambda(evicted) = Lambda(all) - Lambda(of the calibration),
// and eta alike. Data only adds information, so that the difference is
// semidefinite. It holds what an evicted segment says about theta, and what it
// says through the states of a neighbour that is calibrated on: nothing counts
// twice, and the two together are what a calibration on all of the data would
// linearise to. Each observation belongs to one segment; a landmark that
// several see is a landmark of each.
//
// Pure functions, any thread, deterministic.
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

// One segment of all; `ends` must outlive the call.
struct JoinedSegment {
  const SegmentEnds* ends = nullptr;
  // The calibration has its data. Its ends should be linearised at the point,
  // as its data allows.
  bool calibrated_on = false;
  // Its residuals over what is expected of them (ResidualStatistics::fit): its
  // noise counts as so many times larger. At most 1: as expected, or not
  // measured.
  double fit = 1;
  // When it was received: for the walk between sessions.
  std::int64_t time_ns = 0;
};

struct EvictedOptions {
  // theta random-walks by these densities (D) [tangent units / sqrt(s)]: what
  // is older than the newest segment says less. Empty: theta is constant.
  Eigen::VectorXd walk = {};
  // The noise is so many times what the rig states, as the calibration found.
  double noise_factor = 1;
  // Groups of parameters that have changed before, and may go on to.
  std::vector<std::string> changing = {};
};

// A segment that was linearised further than this from the point, rms over the
// free components in reference sigmas, is left out.
inline constexpr double kMaxReach = 2.0;
bool IsTooFar(const Rig& rig,
              const SegmentEnds& ends,
              const Calibration& point);

struct EvictedInformation {
  ThetaInformation information;  // about theta [-] point
  int segments = 0;              // without data, that it stands on
  int left_out = 0;              // linearised too far away
  double reach = 0;              // the largest of those that it stands on
};

// Weight of the k-th segment (from 1) that was linearised so far from the point
// [reference sigmas, rms]. A linearisation is off by what is quadratic in the
// reach, and by the same for all segments alike, so that their sum has an error
// that does not average out: k segments are worth k / (1 + 0.015 k reach^4) of
// them. (Measured: 20 simulated segments have a NEES of 1.33 of its expectation
// at a reach of 1, and of 2.65 at 1.7.) This is the last one's part in it.
double ReachWeight(int k, double reach);

// Segments in the order of time, each session in one run. A segment that
// contradicts the others is for the caller to leave out.
EvictedInformation InformationOfEvicted(const Rig& rig,
                                        const Calibration& point,
                                        std::span<const JoinedSegment> segments,
                                        const EvictedOptions& options = {});

// About theta [-] point, of all segments alike, whether the calibration has
// their data or not; those that were linearised too far away are left out.
ThetaInformation InformationOfAll(const Rig& rig,
                                  const Calibration& point,
                                  std::span<const JoinedSegment> segments,
                                  const EvictedOptions& options = {});

}  // namespace selfcal
