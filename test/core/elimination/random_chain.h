// Random chains of whitened rows, and the same problem as one dense matrix.
#pragma once

#include <Eigen/Core>
#include <random>
#include <vector>

#include "core/elimination/chain_elimination.h"

namespace selfcal {

struct Chain {
  int shared_size = 0;
  std::vector<LinkRows> links;  // one less than keyframes
  std::vector<ChainStateMatrix> priors;
  // Sorted by the first keyframe of each.
  std::vector<std::vector<LandmarkRows>> landmarks;
  double landmark_prior = 0;

  int keyframes() const { return static_cast<int>(priors.size()); }
};

struct ChainShape {
  int keyframes = 8;
  int cameras = 1;
  int camera_size = 11;
  int landmarks_per_keyframe = 4;
  int max_track = 5;  // keyframes from the first to the last that sees it
  double seen = 0.8;  // of the keyframes within a track
};

inline constexpr int kLinkShared = 15;

Chain RandomChain(const ChainShape& shape, std::mt19937* random);

SharedInformation Eliminate(const Chain& chain, ChainElimination* elimination);

// All rows as one matrix; columns: landmarks, states in time order, shared.
struct DenseProblem {
  Eigen::MatrixXd J;
  Eigen::VectorXd r;
};
DenseProblem MakeDense(const Chain& chain);

// Marginal information of the last `shared_size` columns, by Householder QR in
// extended precision.
SharedInformation DenseReference(const Chain& chain);

}  // namespace selfcal
