// Recommends the motion with the highest expected gain now, from the
// information about theta and the predicted information of a segment of each
// primitive motion.
//
// With Lambda the present information (prior included) and Lambda_i that of a
// motion, the gain is 1/2 ln det((Lambda + Lambda_i) / Lambda) [nat] over the
// free components; that of a group is the same for its marginal covariance.
// This is linear algebra of the size of theta: fast enough to run after every
// segment.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/coach/predict.h"
#include "core/information/fusion.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"

namespace selfcal {

inline constexpr int kWeakestDirections = 3;

struct GroupGain {
  std::string group;
  double gain_nats = 0;
};

struct SigmaChange {
  std::string component;
  std::string unit;
  double sigma_now = 0;  // in the unit
  double sigma_after = 0;
};

struct Advice {
  std::string_view motion;  // Primitive::name
  std::string_view instruction;
  double gain_nats = 0;             // of all free components together
  std::vector<GroupGain> groups;    // in the order of rig.groups
  std::vector<SigmaChange> sigmas;  // of the free components, in their order
};

// One of the least known directions of theta, as a unit vector in units of the
// reference sigmas.
struct WeakDirection {
  std::string words;
  std::vector<UnobservedDirection::Part> parts;  // largest first
  double sigma = 0;  // in reference sigmas: 1 after one typical segment
};

struct Coaching {
  std::vector<Advice> advice;  // for every motion, by gain
  std::vector<WeakDirection>
      weakest;  // the kWeakestDirections least known ones
};

// `known` is D x D, of theta's tangent at predictions.theta: positive definite
// on the free components of the rig; other components are ignored.
Coaching Advise(const Rig& rig,
                const Predictions& predictions,
                const Eigen::MatrixXd& known);

// Sums the information of a calibration about theta (D x D covariance at it,
// prior included) and of segments that are not part of it, transported to it.
// Not finite if the covariance is not positive definite on the free components.
Eigen::MatrixXd KnownInformation(
    const Rig& rig,
    const Calibration& theta,
    const Eigen::MatrixXd& covariance,
    std::span<const SegmentInformation> since = {});

}  // namespace selfcal
