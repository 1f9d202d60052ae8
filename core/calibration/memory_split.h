// Whether all that is remembered of a device is of one device: whether its
// newest segments show another theta than those before.
//
// A change that is too small for single segments to show stands out where
// segments are joined at their ends (session_chain.h) and few parameters are
// tested at a time, as if all others had stayed: what the segments newer than a
// point in time show against what those before show.
//
// Pure, any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>

#include "core/calibration/evicted_information.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"

namespace selfcal {

struct MemorySplit {
  // By chance, of the split and the parameters that stand out most, with the
  // number of those that were tried accounted for; 1: none was tried.
  double probability = 1;
  int newer = 0;      // segments after it
  std::string block;  // parameters that differ (parameter_blocks.h)
};

// Segments in the order of time, linearised near `theta`; `estimated` are the
// orthonormal directions in units of the prior (D x r) that data determines
// (subspace.h), to which the test keeps. Variances are larger by `excess`.
MemorySplit FindSplit(const Rig& rig,
                      const Calibration& theta,
                      const Eigen::MatrixXd& estimated,
                      double excess,
                      std::span<const JoinedSegment> segments,
                      const EvictedOptions& options);

}  // namespace selfcal
