// Determines which groups of parameters a change concerns, and the probability
// that it also concerns one of the others.
//
// Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "core/change/consistency.h"

namespace selfcal {

// ln of the ratio of the likelihoods of the data under an offset within the
// span of B (orthonormal) and under none: the offset is normal, with `sigma` of
// the prior's in each direction.
double LogEvidence(const OffsetInformation& change,
                   const Eigen::MatrixXd& B,
                   double sigma = 1);

struct GroupConcern {
  std::string group;
  // Test of a change of the group, with the groups that were found concerned
  // before eliminated and the others unchanged.
  ConsistencyTest test;
  bool concerned = false;
};

// The result is in the order of the groups (GroupParts). The group that
// explains the change best is concerned if its probability is below `level`;
// then each of the others for which that holds with these eliminated. There may
// be none.
std::vector<GroupConcern> FindConcerned(const std::vector<ThetaPart>& groups,
                                        const OffsetInformation& change,
                                        double level);

// Names of the concerned groups. If none is significant, the names of all: the
// change is in one of them.
std::vector<std::string> ConcernedNames(
    const std::vector<GroupConcern>& groups);

// Possible change of the groups that were not found concerned: E[x x^T] of
// each, D x D in tangent units, 0 for those of `concerned` and for components
// that the rig holds fixed. It is to be added to a covariance from before the
// change.
//
// The prior probability that a group has changed too is one half; the change x
// is normal, of unknown size: 0.01 to 1 prior sigmas. The segments since the
// change make both more certain: a change that they would reveal is improbable,
// and one that they would not reveal is small.
Eigen::MatrixXd DoubtOfUnconcerned(const Rig& rig,
                                   const KnownCalibration& before,
                                   std::span<const SegmentInformation> since,
                                   const std::vector<std::string>& concerned);

}  // namespace selfcal
