// Completes a calibration on the segments with data by the information of
// segments without data.
//
// The estimate from data comes first. It decides which directions are
// determined, what the noise scales are, and which segments contradict the
// rest. The information of the other segments (remembered_information.h) is
// then added within the determined directions only, in one linear step: only
// data can distinguish actual information from noise in states that looks like
// motion, so that segments without data never determine directions that those
// with data do not.
//
// Pure, callable from any thread, deterministic.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/calibration/remembered_information.h"
#include "core/calibration/remembered_segment.h"
#include "core/calibration/subspace.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// Result of a calibration on data alone.
struct DataEstimate {
  // theta = reference [+] d.
  Calibration reference;
  Eigen::VectorXd d;
  ThetaSubspace subspace;
  // Information of data and prior with respect to d (D x D).
  Eigen::MatrixXd Lambda;
  // Factor on covariances: segments disagree by more than their information
  // predicts.
  double excess = 1;
  // Upper bound of the noise scales of pixels and IMU. Information that was
  // linearised with the stated noise is weighted as if all noise were this much
  // larger, so that it is not overconfident, whatever its kind.
  double noise_scale = 1;
};

// If nothing is added to the estimate from data, only `use` is set.
struct CompletedEstimate {
  Calibration theta;
  Eigen::MatrixXd covariance;  // D x D, tangent at theta
  // Information that was added (D x D, tangent at theta).
  Eigen::MatrixXd Lambda;
  RememberedUse use;
};

// `segments` are those with data, on which the estimate is based. `remembered`
// come in the order of time, with those of a session consecutive; those that
// have no ends and are not in `segments` are ignored. The noise in `options` is
// ignored; `estimate` has it. `rig` states the noise with which the ends were
// computed. None is used, and `use.unused` gives the reason, if most of them,
// or all together, contradict the estimate, or were linearised too far from it.
// The result reports whether the newest of all segments differ from those
// before (memory_split.h), and its covariance accounts for the remaining doubt,
// even if no segment is without data.
CompletedEstimate FuseRemembered(
    const Rig& rig,
    const DataEstimate& estimate,
    const std::vector<const MotionSegment*>& segments,
    const std::vector<RememberedSegment>& remembered,
    const RememberedOptions& options);

}  // namespace selfcal
