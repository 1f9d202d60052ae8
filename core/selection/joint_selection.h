// The joint selection: the bounded set of segments with the most joint
// information about theta, with common information counted once
// (shared_landmarks.h). A table scores each segment alone and ignores
// directions; the joint selection scores the contribution of a segment to the
// others.
//
// Every criterion is expressed in nats: as 1/2 ln det of the isotropic
// information in all D directions that has the same
//   D: determinant,
//   A: mean variance, in units of sigma_ref,
//   E: smallest eigenvalue, in units of the prior.
// The information is that of the set with the prior, over the free components.
//
// Values and pure functions, deterministic; storage is the caller's concern.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "core/model/rig.h"
#include "core/selection/candidate.h"
#include "core/selection/tables.h"

namespace selfcal {

enum class Criterion { kD, kA, kE };

struct JointSettings {
  Criterion criterion = Criterion::kD;
  int capacity = 0;  // maximum number of segments kept
  // A segment must gain this relative to the prior, and a capacity-th part of
  // it relative to the kept set, so that the whole set gains at least this.
  double min_gain_nats = 1;
  // If false, segments are treated as if they had no common landmarks.
  bool share_landmarks = true;
  // prior / sigma_ref of each free component.
  Eigen::VectorXd prior_in_reference;
};

// Uses the total capacity of the rig's tables, Q N, and the rig's rules.
JointSettings MakeJointSettings(const Rig& rig, Criterion criterion);

// The criterion of a rig with a joint selection.
Criterion CriterionOf(Selection selection);

// Value of information in units of the prior, the prior included [nat].
double JointValue(const JointSettings& settings,
                  const Eigen::MatrixXd& information);

// Value of a set [nat].
double JointValue(const JointSettings& settings,
                  std::span<const Candidate> set);

struct JointChange {
  bool inserted = false;
  std::optional<int> evicted;  // index into the set before the change
  // 1/2 ln det with the candidate minus without, relative to the whole set
  // [nat].
  double gain = 0;
};

// Decides about one more segment: reject it, insert it, or replace with it the
// segment whose removal leaves the most information. A candidate with a key of
// the set changes nothing, nor does one with a value that is not finite; `set`
// is in order of arrival. While there is room, a segment with sufficient gain
// enters; a full set changes only if the criterion grows by min_gain_nats /
// capacity. Gains are of 1/2 ln det, whatever the criterion, which only decides
// about replacements. Of equal segments the older ones stay.
JointChange Offer(const JointSettings& settings,
                  const Candidate& candidate,
                  std::span<const Candidate> set);

// The same for the table of a rig with a joint selection; `set` are the
// candidates of its entries in order of arrival.
JointChange Decide(const Rig& rig,
                   const Candidate& candidate,
                   std::span<const Candidate> set,
                   const Table& table);

// Applies to the table what was decided on its entries, whose keys are `set`,
// in order of arrival, and counts it as Offer() of tables.h does. The entropy
// of an entry is that of all of theta after its segment alone; its gain is
// relative to the set that it entered.
TableUpdate Apply(const Rig& rig,
                  const Candidate& candidate,
                  const JointChange& change,
                  std::span<const SegmentKey> set,
                  Table* table);

// Offers all candidates in order of arrival and returns the resulting set:
// indices, ascending.
std::vector<int> SelectStreaming(const JointSettings& settings,
                                 std::span<const Candidate> candidates);

// Selects a set with all candidates known at once: repeatedly adds the one that
// contributes most, then exchanges a selected one for another as long as that
// improves the criterion. Indices, ascending.
std::vector<int> SelectGreedily(const JointSettings& settings,
                                std::span<const Candidate> candidates);

}  // namespace selfcal
