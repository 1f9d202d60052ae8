#include "core/calibration/linear_chains.h"

#include <algorithm>
#include <cmath>

namespace selfcal {
namespace {

constexpr int kNone = -1;
constexpr int kMinObservations = 2;
constexpr int kBiases = 6;

// Half of a walk from a to b, between the biases of one of them and those in
// its middle: twice the information, and half of the residual.
KeptBiasRows HalfWalkRows(const BiasLink& link,
                          const KeyframeState& a,
                          const KeyframeState& b,
                          double sign_of_bias) {
  const Eigen::Matrix<double, kBiases, 1> weight =
      std::sqrt(2.0) * link.sigmas.cwiseInverse();
  Eigen::Matrix<double, kBiases, 1> off;
  off << b.b_a - a.b_a, b.b_g - a.b_g;
  return {.by_bias = sign_of_bias * weight,
          .by_kept = -sign_of_bias * weight,
          .residual = 0.5 * weight.cwiseProduct(off)};
}

// Adds the unknowns from `first` in the interface to those that a chain keeps.
int KeepInChain(int first, int size, ChainPlan* chain) {
  const int kept = static_cast<int>(chain->interface.size());
  for (int i = 0; i < size; ++i) chain->interface.push_back(first + i);
  return kept;
}

bool HasWeight(const LinearObservation& seen) { return seen.weight > 0; }

std::vector<KeyframeChain> FindChains(const CalibrationProblem& problem) {
  const int keyframes = static_cast<int>(problem.keyframes.size());
  std::vector<bool> joined(keyframes, false);  // with the next one
  for (const InertialLink& link : problem.inertial_links) {
    joined[link.before] = true;
  }
  std::vector<KeyframeChain> chains;
  for (int k = 0; k < keyframes; ++k) {
    if (k == 0 || !joined[k - 1]) chains.push_back({k, k});
    chains.back().end = k + 1;
  }
  return chains;
}

// Empty chains; returns the chain of each keyframe.
std::vector<int> StartChains(const CalibrationProblem& problem,
                             const ChainThetas& thetas,
                             EliminationPlan* plan) {
  const std::vector<KeyframeChain> ranges = FindChains(problem);
  plan->chains.resize(ranges.size());
  std::vector<int> chain_of_keyframe(problem.keyframes.size());
  for (std::size_t c = 0; c < ranges.size(); ++c) {
    ChainPlan& chain = plan->chains[c];
    chain.range = ranges[c];
    chain.theta = thetas.IndexOf(ranges[c].begin);
    chain.landmarks.clear();
    chain.tracks.assign(1, 0);
    chain.track_keyframes.clear();
    chain.kept_landmarks.clear();
    chain.interface.clear();
    chain.walk_in = {};
    chain.walk_out = {};
    std::fill(chain_of_keyframe.begin() + ranges[c].begin,
              chain_of_keyframe.begin() + ranges[c].end,
              static_cast<int>(c));
  }
  return chain_of_keyframe;
}

// Adds a piece of a track, without its observations of zero weight. `first`:
// of the landmark in the interface, or kNone.
void AddPiece(int landmark,
              int first,
              int cameras,
              std::span<LinearObservation> piece,
              ChainPlan* chain) {
  for (LinearObservation& seen : piece) {
    if (!HasWeight(seen)) continue;
    seen.factor = static_cast<int>(chain->track_keyframes.size());
    chain->track_keyframes.push_back(seen.view / cameras - chain->range.begin);
  }
  int kept = kNone;
  if (first != kNone) {
    kept = !chain->landmarks.empty() && chain->landmarks.back() == landmark
               ? chain->kept_landmarks.back()
               : KeepInChain(first, 3, chain);
  }
  chain->tracks.push_back(static_cast<int>(chain->track_keyframes.size()));
  chain->landmarks.push_back(landmark);
  chain->kept_landmarks.push_back(kept);
}

// Finds the tracks of each chain. A landmark with several pieces is kept.
void PlanTracks(const std::vector<int>& chain_of_keyframe,
                LinearObservations* observations,
                EliminationPlan* plan) {
  const int cameras = observations->cameras();
  plan->interface_of_landmark.assign(observations->landmarks(), kNone);
  for (int m = 0; m < observations->landmarks(); ++m) {
    const std::span<LinearObservation> track = observations->OfLandmark(m);
    int held = 0;
    int first_piece = kNone, last_piece = kNone;  // with a weight
    for (const LinearObservation& seen : track) {
      if (!HasWeight(seen)) continue;
      ++held;
      last_piece = seen.piece;
      if (first_piece == kNone) first_piece = last_piece;
    }
    if (held < kMinObservations) continue;
    int& first = plan->interface_of_landmark[m];
    if (first_piece != last_piece) {
      first = plan->interface_size;
      plan->interface_size += 3;
    }
    for (std::size_t begin = 0; begin < track.size();) {
      std::size_t end = begin + 1;
      while (end < track.size() && track[end].piece == track[begin].piece) {
        ++end;
      }
      const auto piece = track.subspan(begin, end - begin);
      if (std::any_of(piece.begin(), piece.end(), HasWeight)) {
        const int chain = chain_of_keyframe[piece.front().view / cameras];
        AddPiece(m, first, cameras, piece, &plan->chains[chain]);
      }
      begin = end;
    }
  }
}

void PlanWalks(const LinearPoint& point,
               const std::vector<int>& chain_of_keyframe,
               EliminationPlan* plan) {
  const std::vector<KeyframeState>& x = point.keyframes;
  for (const BiasLink& link : point.problem.bias_links) {
    ChainPlan& before = plan->chains[chain_of_keyframe[link.before]];
    ChainPlan& after = plan->chains[chain_of_keyframe[link.after]];
    const auto half = [&](double sign_of_bias, ChainPlan* chain) {
      return HalfWalk{
          KeepInChain(plan->interface_size, kBiases, chain),
          HalfWalkRows(link, x[link.before], x[link.after], sign_of_bias)};
    };
    before.walk_out = half(-1, &before);
    after.walk_in = half(1, &after);
    plan->walk_squares += 2 * after.walk_in.rows.residual.squaredNorm();
    plan->interface_size += kBiases;
  }
}

}  // namespace

void PlanElimination(const LinearPoint& point,
                     LinearObservations* observations,
                     EliminationPlan* plan) {
  const std::vector<int> chain_of_keyframe =
      StartChains(point.problem, point.thetas, plan);
  plan->interface_size = 0;
  plan->walk_squares = 0;
  PlanTracks(chain_of_keyframe, observations, plan);
  PlanWalks(point, chain_of_keyframe, plan);
}

}  // namespace selfcal
