#include "core/selection/joint_selection.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/model/symmetric_eigen.h"
#include "core/selection/shared_landmarks.h"

namespace selfcal {
namespace {

// Values that differ by less are treated as equal, so that rounding does not
// decide.
constexpr double kTie_nats = 1e-9;
constexpr int kMaxExchanges = 1000;

double HalfLogDet(const Eigen::MatrixXd& matrix) {
  return matrix.llt().matrixLLT().diagonal().array().log().sum();
}

std::vector<int> Iota(int size) {
  std::vector<int> all(size);
  for (int i = 0; i < size; ++i) all[i] = i;
  return all;
}

std::vector<int> Without(std::vector<int> members, int member) {
  std::erase(members, member);
  return members;
}

std::vector<int> With(std::vector<int> members, int member) {
  members.insert(std::upper_bound(members.begin(), members.end(), member),
                 member);
  return members;
}

// Values of subsets of the candidates.
class Subsets {
 public:
  Subsets(const JointSettings& settings,
          const std::vector<const Candidate*>& candidates)
      : settings_(settings), shared_(candidates) {}

  Eigen::MatrixXd Information(const std::vector<int>& members) const {
    return settings_.share_landmarks ? shared_.Information(members)
                                     : shared_.Sum(members);
  }
  double Value(const std::vector<int>& members) const {
    return JointValue(settings_, Information(members));
  }
  // The allocation of landmarks to these members.
  SharedLandmarks::Allocation Allocate(const std::vector<int>& members) const {
    SharedLandmarks::Allocation parts = shared_.Uniform();
    if (settings_.share_landmarks) shared_.Information(members, &parts);
    return parts;
  }
  // The same for a set of almost the members that `parts` were allocated to.
  double Value(const std::vector<int>& members,
               SharedLandmarks::Allocation parts) const {
    return JointValue(settings_,
                      settings_.share_landmarks
                          ? shared_.Information(members, &parts)
                          : shared_.Sum(members));
  }
  double HalfLogDetOf(const std::vector<int>& members) const {
    return HalfLogDet(Information(members));
  }

  double MinGainOfOne() const {
    return settings_.min_gain_nats / std::max(1, settings_.capacity);
  }
  // Returns true if the candidate alone has sufficient gain.
  bool Enough(int candidate) const {
    return HalfLogDetOf({candidate}) >= settings_.min_gain_nats;
  }

 private:
  const JointSettings& settings_;
  const SharedLandmarks shared_;
};

std::vector<const Candidate*> Pointers(std::span<const Candidate> candidates) {
  std::vector<const Candidate*> pointers;
  for (const Candidate& candidate : candidates) pointers.push_back(&candidate);
  return pointers;
}

// Entropy of all of theta after this segment alone, normalised by sigma_ref.
double JointEntropy(const JointSettings& settings, const Candidate& candidate) {
  const auto size = candidate.information.rows();
  return static_cast<double>(size) / 2 *
             std::log(2 * std::numbers::pi * std::numbers::e) +
         settings.prior_in_reference.array().log().sum() -
         HalfLogDet(Eigen::MatrixXd::Identity(size, size) +
                    candidate.information);
}

// The member whose removal leaves the most information.
struct Removal {
  int member = -1;
  double value = 0;  // of the rest
};

// The best removal among `removable`, ascending; of equal ones the last.
// `parts` are allocated to the members.
Removal CheapestRemoval(const Subsets& subsets,
                        const std::vector<int>& members,
                        const std::vector<int>& removable,
                        const SharedLandmarks::Allocation& parts) {
  Removal best;
  for (auto it = removable.rbegin(); it != removable.rend(); ++it) {
    const double value = subsets.Value(Without(members, *it), parts);
    if (best.member < 0 || value > best.value + kTie_nats) best = {*it, value};
  }
  return best;
}

// Fills up to the capacity, each time with the candidate that contributes most.
std::vector<int> GrowGreedily(const Subsets& subsets,
                              const std::vector<int>& candidates,
                              int capacity) {
  std::vector<int> kept;
  double value = subsets.Value(kept);
  double half_log_det = 0;
  while (static_cast<int>(kept.size()) < capacity) {
    int best = -1;
    for (const int i : candidates) {
      if (std::binary_search(kept.begin(), kept.end(), i)) continue;
      const std::vector<int> with = With(kept, i);
      const double with_i = subsets.Value(with);
      if ((best < 0 || with_i > value + kTie_nats) &&
          subsets.HalfLogDetOf(with) - half_log_det >= subsets.MinGainOfOne()) {
        best = i;
        value = with_i;
      }
    }
    if (best < 0) break;
    kept = With(kept, best);
    half_log_det = subsets.HalfLogDetOf(kept);
  }
  return kept;
}

}  // namespace

JointSettings MakeJointSettings(const Rig& rig, Criterion criterion) {
  JointSettings settings;
  settings.criterion = criterion;
  settings.capacity = static_cast<int>(rig.groups.size()) * rig.table_size;
  settings.min_gain_nats = rig.min_gain_nats;
  const std::vector<int> free = FreeComponents(rig);
  settings.prior_in_reference =
      PriorSigmas(rig)(free).cwiseQuotient(ReferenceSigmas(rig)(free));
  return settings;
}

Criterion CriterionOf(Selection selection) {
  switch (selection) {
    case Selection::kJointA:
      return Criterion::kA;
    case Selection::kJointE:
      return Criterion::kE;
    case Selection::kTables:
    case Selection::kJointD:
      break;
  }
  return Criterion::kD;
}

double JointValue(const JointSettings& settings,
                  const Eigen::MatrixXd& information) {
  const auto size = information.rows();
  if (size == 0) return 0;
  const double half = static_cast<double>(size) / 2;
  switch (settings.criterion) {
    case Criterion::kD:
      break;
    case Criterion::kA: {
      const Eigen::MatrixXd root = information.llt().matrixL().solve(
          Eigen::MatrixXd(settings.prior_in_reference.asDiagonal()));
      return -half * std::log(root.squaredNorm() / static_cast<double>(size));
    }
    case Criterion::kE: {
      return half * std::log(SymmetricEigenvalues(information).minCoeff());
    }
  }
  return HalfLogDet(information);
}

double JointValue(const JointSettings& settings,
                  std::span<const Candidate> set) {
  if (set.empty()) {
    const auto size = settings.prior_in_reference.size();
    return JointValue(settings, Eigen::MatrixXd::Identity(size, size));
  }
  return Subsets(settings, Pointers(set))
      .Value(Iota(static_cast<int>(set.size())));
}

JointChange Offer(const JointSettings& settings,
                  const Candidate& candidate,
                  std::span<const Candidate> set) {
  JointChange change;
  const auto same_key = [&](const Candidate& kept) {
    return kept.key == candidate.key;
  };
  if (settings.capacity <= 0 || !candidate.information.allFinite() ||
      std::any_of(set.begin(), set.end(), same_key)) {
    return change;
  }
  std::vector<const Candidate*> candidates = Pointers(set);
  candidates.push_back(&candidate);
  const Subsets subsets(settings, candidates);
  const int next = static_cast<int>(set.size());
  const std::vector<int> kept = Iota(next);
  const std::vector<int> all = Iota(next + 1);
  change.gain = subsets.HalfLogDetOf(all) - subsets.HalfLogDetOf(kept);
  if (!subsets.Enough(next) || !(change.gain >= subsets.MinGainOfOne())) {
    return change;
  }
  if (next < settings.capacity) {
    change.inserted = true;
    return change;
  }
  const SharedLandmarks::Allocation parts = subsets.Allocate(all);
  const Removal removal = CheapestRemoval(subsets, all, kept, parts);
  if (removal.value >= subsets.Value(kept, parts) + subsets.MinGainOfOne()) {
    change.inserted = true;
    change.evicted = removal.member;
  }
  return change;
}

JointChange Decide(const Rig& rig,
                   const Candidate& candidate,
                   std::span<const Candidate> set,
                   const Table& table) {
  JointSettings settings = MakeJointSettings(rig, CriterionOf(rig.selection));
  settings.capacity = table.capacity;
  return Offer(settings, candidate, set);
}

TableUpdate Apply(const Rig& rig,
                  const Candidate& candidate,
                  const JointChange& change,
                  std::span<const SegmentKey> set,
                  Table* table) {
  TableUpdate result;
  std::vector<TableEntry>& entries = table->entries;
  const auto find = [&](const SegmentKey& key) {
    return std::find_if(entries.begin(), entries.end(), [&](const auto& e) {
      return e.key == key;
    });
  };
  if (find(candidate.key) != entries.end()) return result;
  ++table->scored;
  if (!change.inserted) return result;
  if (change.evicted) {
    const auto evicted = find(set[*change.evicted]);
    result.evicted = *evicted;
    entries.erase(evicted);
  }
  result.inserted = true;
  const JointSettings settings =
      MakeJointSettings(rig, CriterionOf(rig.selection));
  entries.push_back({candidate.key,
                     candidate.sequence,
                     JointEntropy(settings, candidate),
                     change.gain});
  std::sort(entries.begin(), entries.end(), Better);
  return result;
}

std::vector<int> SelectStreaming(const JointSettings& settings,
                                 std::span<const Candidate> candidates) {
  std::vector<int> indices;
  std::vector<Candidate> kept;
  for (int i = 0; i < static_cast<int>(candidates.size()); ++i) {
    const JointChange change = Offer(settings, candidates[i], kept);
    if (!change.inserted) continue;
    if (change.evicted) {
      indices.erase(indices.begin() + *change.evicted);
      kept.erase(kept.begin() + *change.evicted);
    }
    indices.push_back(i);
    kept.push_back(candidates[i]);
  }
  return indices;
}

std::vector<int> SelectGreedily(const JointSettings& settings,
                                std::span<const Candidate> candidates) {
  const Subsets subsets(settings, Pointers(candidates));
  std::vector<int> usable;
  for (int i = 0; i < static_cast<int>(candidates.size()); ++i) {
    if (subsets.Enough(i)) usable.push_back(i);
  }
  std::vector<int> kept = GrowGreedily(subsets, usable, settings.capacity);
  // Each exchange is that of a full set in Offer(), with the new candidate that
  // helps most.
  for (int exchange = 0; exchange < kMaxExchanges; ++exchange) {
    Removal best;
    int newcomer = -1;
    for (const int i : usable) {
      if (std::binary_search(kept.begin(), kept.end(), i)) continue;
      const std::vector<int> with = With(kept, i);
      const SharedLandmarks::Allocation parts = subsets.Allocate(with);
      const Removal removal = CheapestRemoval(subsets, with, kept, parts);
      if (removal.member >= 0 &&
          removal.value >=
              subsets.Value(kept, parts) + subsets.MinGainOfOne() &&
          (newcomer < 0 || removal.value > best.value + kTie_nats)) {
        best = removal;
        newcomer = i;
      }
    }
    if (newcomer < 0) break;
    kept = With(Without(kept, best.member), newcomer);
  }
  return kept;
}

}  // namespace selfcal
