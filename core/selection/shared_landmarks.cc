#include "core/selection/shared_landmarks.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstdint>
#include <iterator>
#include <limits>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace selfcal {
namespace {

constexpr double kGap_nats = 0.005;
constexpr int kMaxRounds = 100;

// Observations of one landmark by one candidate.
struct Entry {
  int session;  // by the order in which they appear
  std::uint64_t id;
  int candidate;
  double share;
};

// Numbers of the sessions of the candidates.
std::vector<int> NumberSessions(std::span<const Candidate* const> candidates) {
  std::map<std::string, int> numbers;
  std::vector<int> sessions;
  for (const Candidate* candidate : candidates) {
    const int next = static_cast<int>(numbers.size());
    sessions.push_back(
        numbers.emplace(candidate->key.session, next).first->second);
  }
  return sessions;
}

// Entries of each candidate with its share of the observations, limited to
// landmarks for which the sketches of all candidates of its session are
// complete; by landmark.
std::vector<Entry> ComparableEntries(
    std::span<const Candidate* const> candidates) {
  const std::vector<int> sessions = NumberSessions(candidates);
  std::vector<std::uint64_t> known(candidates.size(),
                                   std::numeric_limits<std::uint64_t>::max());
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    std::uint64_t& whole = known[sessions[i]];
    whole = std::min(whole, KnownUpTo(candidates[i]->landmarks));
  }
  std::vector<Entry> entries;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const std::size_t begin = entries.size();
    double observations = 0;
    for (const LandmarkSketch::Entry& entry :
         candidates[i]->landmarks.entries) {
      if (LandmarkHash(entry.id) > known[sessions[i]]) break;
      observations += entry.observations;
      entries.push_back({sessions[i],
                         entry.id,
                         static_cast<int>(i),
                         static_cast<double>(entry.observations)});
    }
    for (std::size_t k = begin; k < entries.size(); ++k) {
      entries[k].share /= observations;
    }
  }
  std::sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) {
    return std::tie(a.session, a.id, a.candidate) <
           std::tie(b.session, b.id, b.candidate);
  });
  return entries;
}

}  // namespace

SharedLandmarks::SharedLandmarks(std::span<const Candidate* const> candidates)
    : candidates_(candidates.begin(), candidates.end()),
      alone_(candidates.size(), 1) {
  const std::vector<Entry> entries = ComparableEntries(candidates);
  for (auto begin = entries.begin(); begin != entries.end();) {
    const auto end = std::find_if(begin, entries.end(), [&](const Entry& e) {
      return e.session != begin->session || e.id != begin->id;
    });
    if (end - begin > 1) {
      for (auto it = begin; it != end; ++it) {
        sights_.push_back({it->candidate, it->share});
        alone_[it->candidate] -= it->share;
      }
      ends_.push_back(sights_.size());
    }
    begin = end;
  }
  // Remaining shares of the size of rounding errors are zero.
  for (double& share : alone_) {
    if (share < 1e-12) share = 0;
  }
}

Eigen::MatrixXd SharedLandmarks::Weighted(
    std::span<const int> members, std::span<const double> weights) const {
  const auto size =
      candidates_.empty() ? 0 : candidates_[0]->information.rows();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Identity(size, size);
  for (const int i : members) sum += weights[i] * candidates_[i]->information;
  return sum;
}

Eigen::MatrixXd SharedLandmarks::Sum(std::span<const int> members) const {
  return Weighted(members, std::vector<double>(candidates_.size(), 1));
}

SharedLandmarks::Allocation SharedLandmarks::Uniform() const {
  return Allocation(sights_.size(), 1);
}

bool SharedLandmarks::Restrict(std::span<const char> is_member,
                               Allocation* parts) const {
  bool contested = false;
  std::size_t begin = 0;
  for (const std::size_t end : ends_) {
    int members = 0;
    double sum = 0;
    for (std::size_t k = begin; k < end; ++k) {
      const bool sees = is_member[sights_[k].candidate] != 0;
      members += sees ? 1 : 0;
      sum += sees ? (*parts)[k] : 0;
    }
    for (std::size_t k = begin; k < end; ++k) {
      if (is_member[sights_[k].candidate] == 0) {
        (*parts)[k] = 0;
      } else {
        (*parts)[k] = sum > 0 ? (*parts)[k] / sum : 1.0 / members;
      }
    }
    contested = contested || members > 1;
    begin = end;
  }
  return contested;
}

Eigen::MatrixXd SharedLandmarks::Information(
    std::span<const int> members) const {
  Allocation parts = Uniform();
  return Information(members, &parts);
}

Eigen::MatrixXd SharedLandmarks::Information(std::span<const int> members,
                                             Allocation* parts) const {
  std::vector<char> is_member(candidates_.size(), 0);
  for (const int i : members) is_member[i] = 1;
  const bool contested = Restrict(is_member, parts);

  // The determinant is a polynomial in the parts with nonnegative coefficients,
  // so that the growth transform of Baum and Eagon (1967) increases it in every
  // round: each part times its derivative, rescaled to a sum of one.
  std::vector<double> weights, slopes(candidates_.size());
  for (int round = 0;; ++round) {
    weights = alone_;
    for (std::size_t k = 0; k < sights_.size(); ++k) {
      weights[sights_[k].candidate] += (*parts)[k] * sights_[k].share;
    }
    Eigen::MatrixXd information = Weighted(members, weights);
    if (!contested || round == kMaxRounds) return information;
    const Eigen::MatrixXd covariance = information.llt().solve(
        Eigen::MatrixXd::Identity(information.rows(), information.cols()));
    for (const int i : members) {
      slopes[i] =
          0.5 * covariance.cwiseProduct(candidates_[i]->information).sum();
    }
    // 1/2 ln det is concave: no allocation exceeds this one by more than the
    // gap.
    double gap = 0;
    Allocation next = *parts;
    std::size_t begin = 0;
    for (const std::size_t end : ends_) {
      double best = 0;
      double now = 0;
      for (std::size_t k = begin; k < end; ++k) {
        const Sight& sight = sights_[k];
        if (is_member[sight.candidate] == 0) continue;
        const double slope = slopes[sight.candidate] * sight.share;
        best = std::max(best, slope);
        next[k] *= slope;
        now += next[k];
      }
      gap += best - now;
      // If no member gains by it, its allocation does not matter.
      for (std::size_t k = begin; k < end; ++k) {
        next[k] = now > 0 ? next[k] / now : (*parts)[k];
      }
      begin = end;
    }
    if (gap < kGap_nats) return information;
    *parts = std::move(next);
  }
}

}  // namespace selfcal
