// Are all segments of a device, with their data or without, of one theta, or do
// its newest show another than those before?
//
// A change that is too small for single segments to show stands out where
// neighbours are joined at their ends (session_chain.h) and few parameters are
// tested at a time, as if all others had stayed. A set of segments from before
// and after a change gives a calibration that is neither, and fits new segments
// half as badly as the one before: that its own segments differ gives it away.
//
// Each session is cut into parts of a few joined segments. Steps and ramps over
// the parts are tried as courses of a change (core/change/course.h) about the
// calibration, of which nothing is known but the prior. A device is handled,
// and grows warm or cold, between sessions more than within one: a half of what
// may be found by chance is for steps between sessions, a quarter for other
// steps, a quarter for ramps.
//
// A change that no test finds is not excluded: all courses and parameters that
// are tried are weighed against no change at all
// (core/change/change_mixture.h), with these shares of one prior.
//
// Pure, any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "core/calibration/evicted_information.h"
#include "core/calibration/remembered_segment.h"
#include "core/change/change_mixture.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

// A split is looked at closer below this probability.
inline constexpr double kRareSplit = 0.05;

struct SplitFindings {
  // The least probable one. If it is not rare, `without_one` is 1 and no group
  // is concerned.
  DeviceSplit split;
  // The chance of a change about theta of the newest segment, in units of the
  // tangent (D); nothing where no course could be tried.
  std::optional<ChangeDoubt> doubt;
};

// Segments in the order of time, each session in one run, linearised near
// `theta`; `estimated` are the orthonormal directions in units of the prior
// (D x r) that data determines (subspace.h), to which tests and doubt keep.
// Variances are larger by `excess`.
SplitFindings FindSplit(const Rig& rig,
                        const Calibration& theta,
                        const Eigen::MatrixXd& estimated,
                        double excess,
                        std::span<const JoinedSegment> segments,
                        const EvictedOptions& options);

}  // namespace selfcal
