#include "core/change/group_concern.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/change/change_mixture.h"
#include "core/change/concerned.h"
#include "core/change/course.h"
#include "core/change/sized_change.h"

namespace selfcal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kEvenOdds = 0.5;

// Remaining information for others if the components `at` may have changed as
// well, with only their prior known.
OffsetInformation Eliminate(const OffsetInformation& change,
                            const std::vector<int>& at) {
  if (at.empty()) return change;
  MatrixXd block = change.Lambda(at, at);
  block.diagonal().array() += 1;
  const MatrixXd across = change.Lambda(Eigen::all, at);
  const MatrixXd gain = block.llt().solve(across.transpose()).transpose();
  return {change.Lambda - gain * across.transpose(),
          change.eta - gain * change.eta(at)};
}

std::vector<int> Union(std::vector<int> a, const std::vector<int>& b) {
  a.insert(a.end(), b.begin(), b.end());
  std::sort(a.begin(), a.end());
  a.erase(std::unique(a.begin(), a.end()), a.end());
  return a;
}

// Directions of the part outside of the components `at`.
MatrixXd Without(const ThetaPart& part, const std::vector<int>& at) {
  std::vector<Eigen::Index> rest;
  for (std::size_t k = 0; k < part.at.size(); ++k) {
    if (!std::binary_search(at.begin(), at.end(), part.at[k])) {
      rest.push_back(static_cast<Eigen::Index>(k));
    }
  }
  return part.basis(Eigen::all, rest);
}

// E[y y^T] of a possible change B y, given L and s along B.
MatrixXd SecondMoment(const MatrixXd& L, const VectorXd& s) {
  ChangeMixture mixture;
  mixture.Add(L, s, MatrixXd::Identity(L.rows(), L.cols()), kEvenOdds);
  const ChangeDoubt doubt = mixture.Doubt();
  return doubt.covariance + doubt.step * doubt.step.transpose();
}

}  // namespace

double LogEvidence(const OffsetInformation& change,
                   const MatrixXd& B,
                   double sigma) {
  return ChangeOfSize(B.transpose() * change.Lambda * B,
                      B.transpose() * change.eta,
                      sigma)
      .log_evidence;
}

std::vector<GroupConcern> FindConcerned(const std::vector<ThetaPart>& groups,
                                        const OffsetInformation& change,
                                        double level) {
  std::vector<GroupConcern> concerns;
  for (const ThetaPart& group : groups) concerns.push_back({group.name, {}});
  std::vector<int> found;
  for (std::size_t round = 0; round < groups.size(); ++round) {
    const OffsetInformation rest = Eliminate(change, found);
    std::optional<std::size_t> best;
    double evidence = 0;
    for (std::size_t q = 0; q < groups.size(); ++q) {
      if (concerns[q].concerned) continue;
      const MatrixXd B = Without(groups[q], found);
      concerns[q].test = TestSpan(rest, B);
      if (concerns[q].test.probability >= level) continue;
      const double of_group = LogEvidence(rest, B);
      if (!best || of_group > evidence) {
        best = q;
        evidence = of_group;
      }
    }
    if (!best) break;
    concerns[*best].concerned = true;
    found = Union(found, groups[*best].at);
  }
  return concerns;
}

std::vector<std::string> ConcernedNames(
    const std::vector<GroupConcern>& groups) {
  std::vector<std::string> names;
  for (const GroupConcern& group : groups) {
    if (group.concerned) names.push_back(group.group);
  }
  if (!names.empty()) return names;
  for (const GroupConcern& group : groups) names.push_back(group.group);
  return names;
}

MatrixXd DoubtOfUnconcerned(const Rig& rig,
                            const KnownCalibration& before,
                            std::span<const SegmentInformation> since,
                            const std::vector<std::string>& concerned) {
  const ConsistencyTester tester(rig, before);
  Course course(tester.root());
  bool any = false;
  for (const SegmentInformation& information : since) {
    if (!tester.Accepts(information)) continue;
    course.Add(tester.Offset(information), 1);
    any = true;
  }
  const std::vector<int> free = FreeComponents(rig);
  const auto size = static_cast<Eigen::Index>(free.size());
  OffsetInformation change{MatrixXd::Zero(size, size), VectorXd::Zero(size)};
  if (any) change = course.Change();
  std::vector<int> changed;
  for (const ThetaPart& group : tester.groups()) {
    if (std::count(concerned.begin(), concerned.end(), group.name) > 0) {
      changed = Union(changed, group.at);
    }
  }
  const OffsetInformation rest = Eliminate(change, changed);
  MatrixXd doubt = MatrixXd::Zero(size, size);
  std::vector<int> done = changed;
  for (const ThetaPart& group : tester.groups()) {
    const MatrixXd B = Without(group, done);
    if (B.cols() == 0) continue;
    doubt += B *
             SecondMoment(B.transpose() * rest.Lambda * B,
                          B.transpose() * rest.eta) *
             B.transpose();
    done = Union(done, group.at);
  }
  const VectorXd sigmas = PriorSigmas(rig);
  MatrixXd tangent = MatrixXd::Zero(sigmas.size(), sigmas.size());
  tangent(free, free) =
      sigmas(free).asDiagonal() * doubt * sigmas(free).asDiagonal();
  return tangent;
}

}  // namespace selfcal
