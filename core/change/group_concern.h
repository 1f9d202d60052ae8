// Which groups of parameters a change concerns, and how likely it is that it
// concerns one of the others after all.
//
// Pure, deterministic, any thread.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "core/change/consistency.h"

namespace selfcal {

// ln of how much more probable the data is under an offset within the span of
// B (orthonormal) than under none: normal, with `sigma` of the prior's in each
// direction.
double LogEvidence(const OffsetInformation& change,
                   const Eigen::MatrixXd& B,
                   double sigma = 1);

struct GroupConcern {
  std::string group;
  // Of a change of the group: with those that were found concerned before it
  // eliminated, the others unchanged.
  ConsistencyTest test;
  bool concerned = false;
};

// In the order of the groups (GroupBlocks). The group that explains the change
// best is concerned where its probability is below `level`; then each of the
// rest that is so with these eliminated. None may be.
std::vector<GroupConcern> FindConcerned(
    const std::vector<ParameterBlock>& groups,
    const OffsetInformation& change,
    double level);

// The names of those that are concerned. Where none stands out, of all:
// whichever it is, it is among them.
std::vector<std::string> ConcernedNames(
    const std::vector<GroupConcern>& groups);

// What the groups that a change was not found to concern may have changed by
// all the same: E[x x^T] of each, D x D in the units of the tangent, 0 for
// those of `concerned` and what the rig holds fixed. To be added to a
// covariance from before the change.
//
// With even odds a group has changed along, by a normal x of which the size is
// not known: of 0.01 to 1 prior sigmas. What the segments since the change show
// makes both certain: a change that they would show is improbable, one that
// they would not is as small as that.
Eigen::MatrixXd DoubtOfUnconcerned(const Rig& rig,
                                   const KnownCalibration& before,
                                   std::span<const SegmentInformation> since,
                                   const std::vector<std::string>& concerned);

}  // namespace selfcal
