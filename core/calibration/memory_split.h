// Tests whether all segments of a device, with or without their data, have the
// same theta, or whether its newest segments have another theta than those
// before: a device split.
//
// A device change that is too small to be detected in single segments becomes
// significant when neighbours are joined at their ends (session_chain.h) and
// few parameters are tested at a time, with all others assumed constant. A set
// of segments from before and after a change gives a calibration that matches
// neither, and fits new segments half as badly as the previous one; the
// differences among its own segments reveal it.
//
// Each session is cut into parts of a few joined segments. Steps and ramps over
// the parts are tested as courses of a change (core/change/course.h) about the
// calibration, of which only the prior is known. A device is handled, and warms
// up or cools down, between sessions more than within one: half of the
// false-alarm probability is for steps between sessions, a quarter for other
// steps, a quarter for ramps.
//
// A change that no test finds is still possible: all tested courses and
// parameters are weighed against the hypothesis of no change
// (core/change/change_mixture.h), with these shares of one prior.
//
// Pure, callable from any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "core/calibration/remembered_information.h"
#include "core/calibration/remembered_segment.h"
#include "core/change/change_mixture.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// A split is examined further below this probability.
inline constexpr double kRareSplit = 0.05;

struct SplitFindings {
  // The least probable one, or a drift that explains it as well; its
  // probability and `without_one` are then the least of both. If the
  // probability is not below kRareSplit, `without_one` is 1 and no group is
  // concerned.
  DeviceSplit split;
  // Possible change of theta of the newest segment, in tangent units (D);
  // nullopt if no course could be tested.
  std::optional<ChangeDoubt> doubt;
};

// Segments are in the order of time, with those of a session consecutive,
// linearised near `theta`; `estimated` are the orthonormal directions in units
// of the prior (D x r) that the data determines (subspace.h), to which tests
// and doubt are limited. Variances are scaled by `excess`.
SplitFindings FindSplit(const Rig& rig,
                        const Calibration& theta,
                        const Eigen::MatrixXd& estimated,
                        double excess,
                        std::span<const JoinedSegment> segments,
                        const RememberedOptions& options);

}  // namespace selfcal
