// Directions of theta that the data of a calibration determines, and the
// resulting covariance. Directions are separated in units of the prior: one
// with less information from the data than from the prior is treated as
// unobserved (section IV-A of the paper). Pure, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/rig.h"

namespace selfcal {

// Orthonormal directions in units of PriorSigmas(rig), zero in the components
// that the rig holds fixed; together they span all other components.
struct ThetaSubspace {
  Eigen::MatrixXd estimated;                    // D x r
  Eigen::MatrixXd held;                         // D x h
  std::vector<UnobservedDirection> unobserved;  // h of them
  // Root mean squares of what errors along held directions do to the others
  // beyond the first order, D x k, in units of the tangent (held_bends.h).
  Eigen::MatrixXd bends = {};
};

// All free directions are estimated.
ThetaSubspace WholeSubspace(const Rig& rig);

// Information, in units of the prior, below that of the prior by slightly more
// than rounding: if the prior is part of it, the information is 1 without any
// data.
inline constexpr double kLeastInformation = 1 - 1e-4;

// Splits by Lambda (of the data, in tangent units): a direction is estimated if
// it has the least information or more. At least min_held directions are held
// constant: a direction once found unobserved stays so, to keep rounds of a
// calibration from alternating about the threshold.
ThetaSubspace ObservedSubspace(const Rig& rig,
                               const Eigen::MatrixXd& Lambda,
                               int min_held,
                               double least_information = kLeastInformation);

// Holds the directions `held` (orthonormal, as those of a ThetaSubspace)
// constant, and of the others those with less than kLeastInformation. The
// estimated ones are in the order of their information, least first.
ThetaSubspace HoldDirections(const Rig& rig,
                             const Eigen::MatrixXd& Lambda,
                             const Eigen::MatrixXd& held);

// Basis of the estimated directions in tangent units, D x r: for
// SubspaceManifold.
Eigen::MatrixXd TangentBasis(const Rig& rig, const ThetaSubspace& subspace);

// Lambda on the estimated subspace, r x r, in units of the prior.
Eigen::MatrixXd Reduced(const Rig& rig,
                        const ThetaSubspace& subspace,
                        const Eigen::MatrixXd& Lambda);

// Projects a step of theta (tangent units) on the estimated subspace;
// orthogonal in units of the prior.
Eigen::VectorXd ProjectOnSubspace(const Rig& rig,
                                  const ThetaSubspace& subspace,
                                  const Eigen::VectorXd& step);

// Covariance of theta from its information Lambda (D x D, tangent units): the
// inverse on the estimated subspace, the prior's variance on held directions,
// zero for components that the rig holds fixed.
Eigen::MatrixXd SubspaceCovariance(const Rig& rig,
                                   const ThetaSubspace& subspace,
                                   const Eigen::MatrixXd& Lambda);

// Steps (tangent units) of one sigma of the prior along the held directions,
// with the estimated ones at their minimum by Lambda; D x h.
Eigen::MatrixXd HeldSteps(const Rig& rig,
                          const ThetaSubspace& subspace,
                          const Eigen::MatrixXd& Lambda);

// The covariance of a final estimate. Held directions have the error of the
// prior, which affects the estimated ones where Lambda couples the two: that
// effect is added (as in the Schmidt-Kalman filter for states that are not
// estimated), and so are the bends.
Eigen::MatrixXd CovarianceWithHeld(const Rig& rig,
                                   const ThetaSubspace& subspace,
                                   const Eigen::MatrixXd& Lambda);

// Lambda^-1 eta within the estimated subspace: the undamped Gauss-Newton step.
Eigen::VectorXd SubspaceStep(const Rig& rig,
                             const ThetaSubspace& subspace,
                             const Eigen::MatrixXd& Lambda,
                             const Eigen::VectorXd& eta);

// Largest component of a step of theta in standard deviations; components
// without variance are ignored.
double LargestInSigmas(const Eigen::VectorXd& step,
                       const Eigen::MatrixXd& covariance);

}  // namespace selfcal
