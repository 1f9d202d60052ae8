// Which directions of theta the data of a calibration determines, and what
// follows for its covariance. Directions are told apart in units of the prior:
// one of which the data says less than was known before counts as not observed
// (section IV-A of the method). Pure, any thread.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/rig.h"

namespace selfcal {

// Orthonormal directions in units of PriorSigmas(rig), zero in the components
// that the rig holds fixed; together they span all others.
struct ThetaSubspace {
  Eigen::MatrixXd estimated;                    // D x r
  Eigen::MatrixXd held;                         // D x h
  std::vector<UnobservedDirection> unobserved;  // h of them
};

// Everything that is free is estimated.
ThetaSubspace WholeSubspace(const Rig& rig);

// An information, in units of the prior, just below that of the prior by more
// than rounding: where the prior is part of it, it is 1 without any data.
inline constexpr double kLeastInformation = 1 - 1e-4;

// Splits by what Lambda (of the data, in tangent units) says: estimated is what
// has the least information or more. At least min_held directions are held:
// what was once found unobserved stays so, lest rounds of a calibration
// alternate about the threshold.
ThetaSubspace ObservedSubspace(const Rig& rig,
                               const Eigen::MatrixXd& Lambda,
                               int min_held,
                               double least_information = kLeastInformation);

// Holds the directions `held` (orthonormal, as those of a ThetaSubspace), and
// of the others those with less than kLeastInformation. The estimated ones come
// in the order of their information, least first.
ThetaSubspace HoldDirections(const Rig& rig,
                             const Eigen::MatrixXd& Lambda,
                             const Eigen::MatrixXd& held);

// Basis in tangent units of what is estimated, D x r: for SubspaceManifold.
Eigen::MatrixXd TangentBasis(const Rig& rig, const ThetaSubspace& subspace);

// The part of a step of theta (tangent units) that lies in what is estimated;
// orthogonal in units of the prior.
Eigen::VectorXd ProjectOnSubspace(const Rig& rig,
                                  const ThetaSubspace& subspace,
                                  const Eigen::VectorXd& step);

// Covariance of theta from its information Lambda (D x D, tangent units): the
// inverse on the estimated subspace, the prior's variance on what is held, zero
// for what the rig fixes.
Eigen::MatrixXd SubspaceCovariance(const Rig& rig,
                                   const ThetaSubspace& subspace,
                                   const Eigen::MatrixXd& Lambda);

// The same for an estimate that is done. What is held is off by as much as the
// prior says, and what is estimated leans on it where Lambda couples the two:
// that is added (as Schmidt has it for states that a filter does not estimate).
Eigen::MatrixXd CovarianceWithHeld(const Rig& rig,
                                   const ThetaSubspace& subspace,
                                   const Eigen::MatrixXd& Lambda);

// Lambda^-1 eta within the estimated subspace: the undamped Gauss-Newton step.
Eigen::VectorXd SubspaceStep(const Rig& rig,
                             const ThetaSubspace& subspace,
                             const Eigen::MatrixXd& Lambda,
                             const Eigen::VectorXd& eta);

// Largest component of a step of theta in standard deviations; components
// without variance are left out.
double LargestInSigmas(const Eigen::VectorXd& step,
                       const Eigen::MatrixXd& covariance);

}  // namespace selfcal
