// The joint choice: the bounded set of segments that together say most about
// theta, with what they have in common counted once (shared_landmarks.h). A
// table scores each segment alone and takes no notice of direction; this asks
// what a segment adds to the others.
//
// Every criterion is given in nats: as 1/2 ln det of the information in all D
// directions alike that has the same
//   D: determinant,
//   A: mean variance, in units of sigma_ref,
//   E: smallest eigenvalue, in units of the prior.
// Information is that of the set with the prior, over the free components.
//
// Values and pure functions, deterministic; who stores the set is not known
// here.
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
  int capacity = 0;  // segments kept at most
  // A segment must gain this against the prior, and a capacity-th part of it on
  // top of what is kept, so that a whole set gains it at least.
  double min_gain_nats = 1;
  // False: as if no two segments had a landmark in common.
  bool share_landmarks = true;
  // prior / sigma_ref of each free component.
  Eigen::VectorXd prior_in_reference;
};

// As many as the tables of the rig together, Q N, by its rules.
JointSettings MakeJointSettings(const Rig& rig, Criterion criterion);

// The criterion of a rig with a joint selection.
Criterion CriterionOf(Selection selection);

// Of information in units of the prior, the prior included [nat].
double JointValue(const JointSettings& settings,
                  const Eigen::MatrixXd& information);

// Of a set [nat].
double JointValue(const JointSettings& settings,
                  std::span<const Candidate> set);

struct JointChange {
  bool inserted = false;
  std::optional<int> evicted;  // index into the set as it was
  // 1/2 ln det with the candidate minus without, on top of the whole set [nat].
  double gain = 0;
};

// What is to be done with one more segment: nothing, take it in, or let it take
// the place of the one without which the rest says most. A candidate with a key
// of the set changes nothing; `set` is in order of arrival. While there is
// room, a segment enters that gains enough; a full set changes only where the
// criterion grows by min_gain_nats / capacity. Between equal ones the older
// stay.
JointChange Offer(const JointSettings& settings,
                  const Candidate& candidate,
                  std::span<const Candidate> set);

// The same as a change of the table of a rig with a joint selection, which is
// made, and counted as Offer() of tables.h does. `set` are the candidates of
// its entries in order of arrival. An entry has the entropy of all of theta by
// its segment alone, and the gain on top of the set that it came to.
TableChange Offer(const Rig& rig,
                  const Candidate& candidate,
                  std::span<const Candidate> set,
                  Table* table);

// The set that offering all candidates in order of arrival leaves: indices,
// ascending.
std::vector<int> SelectStreaming(const JointSettings& settings,
                                 std::span<const Candidate> candidates);

// The set for who knows all candidates at once: the one that adds most, again
// and again, and then exchanges of one kept for one left out while there is one
// that helps. Indices, ascending.
std::vector<int> SelectGreedily(const JointSettings& settings,
                                std::span<const Candidate> candidates);

}  // namespace selfcal
