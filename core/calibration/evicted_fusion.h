// A calibration on the segments that have their data, completed by what the
// segments without data say.
//
// The estimate comes from data first, and by it is decided which directions
// are determined, by what the noise is off, and which segments contradict the
// rest. What the others say (evicted_information.h) is then added within the
// determined directions alone, in one linear step: noise in states that is
// taken for motion would be told from information by the data only, so that
// segments without it never determine what those with data do not.
//
// Pure, any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/calibration/evicted_information.h"
#include "core/calibration/remembered_segment.h"
#include "core/calibration/subspace.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// A calibration on data alone.
struct DataEstimate {
  // theta = reference [+] d.
  Calibration reference;
  Eigen::VectorXd d;
  ThetaSubspace subspace;
  // Of data and prior, by d (D x D).
  Eigen::MatrixXd Lambda;
  // Covariances are larger by this: segments disagree by more than they say.
  double excess = 1;
  // The noise of pixels and IMU is at most so many times what the rig states:
  // what was linearised with the stated noise counts as if all were so large,
  // and says no more than it should, whatever kind it is.
  double noise_factor = 1;
};

// Where nothing is added to the estimate from data, nothing but `use` is set.
struct CompletedEstimate {
  Calibration theta;
  Eigen::MatrixXd covariance;  // D x D, tangent at theta
  // What was added (D x D, tangent at theta).
  Eigen::MatrixXd Lambda;
  EvictedUse use;
};

// `segments` are those with data that the estimate stands on; `remembered`
// come in the order of time, each session in one run: of these, those that
// have no ends and are not in `segments` are passed over. `options`
// say nothing about noise: `estimate` does. `rig` states its noise, with which
// the ends were computed. None is used, and `use.unused` says why, where most
// of them, or all together, contradict the estimate, or were linearised too far
// from it. Whether the newest of all segments differ from those before
// (memory_split.h) is told, and the result accounts for what is left open, also
// where none is without data.
CompletedEstimate FuseEvicted(const Rig& rig,
                              const DataEstimate& estimate,
                              const std::vector<const MotionSegment*>& segments,
                              const std::vector<RememberedSegment>& remembered,
                              const EvictedOptions& options);

}  // namespace selfcal
