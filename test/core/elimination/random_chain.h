// Random chains of whitened factors, and the same problem as one dense matrix.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "core/elimination/chain_elimination.h"

namespace selfcal {

// A factor of landmark_rows.h.
struct ChainObservation {
  int keyframe = 0;
  int camera = 0;
  Eigen::Matrix<double, 2, 3> turn, position;
  Eigen::Matrix2Xd own;
  Eigen::Vector2d residual;
  // The derivative with respect to the rotation of the keyframe is [turn |
  // position] by_rotation.
  ChainElimination::PoseRotation by_rotation =
      ChainElimination::PoseRotation::Identity();
};

// Rows between a keyframe and the next, as many as unknowns of a state; then
// further ones, whose x0 is zero.
struct ChainRows {
  Eigen::VectorXd residual;
  Eigen::MatrixXd x0, x1, shared;
};

struct Chain {
  int link_size = 0;
  int state_size = kChainStateSize;
  std::vector<LandmarkRows> cameras;
  std::vector<ChainRows> links;  // one less than keyframes
  std::vector<ChainStateMatrix> priors;
  std::vector<std::vector<ChainObservation>> landmarks;
  double landmark_prior = 0;             // information
  Eigen::Vector3d landmark_prior_slope;  // g of x^T H x + 2 g^T x
  // Landmarks that are kept, by three unknowns each; after them 15 unknowns to
  // which the state of the keyframe in the middle is tied, and six that rows
  // connect with the biases of the first and the last keyframe.
  std::vector<int> kept_landmarks;  // first unknown of each, or -1
  int kept = 0;
  int kept_state_at = 0;
  ChainStateVector kept_state =
      ChainStateVector::Zero(kChainStateSize);  // information
  std::optional<std::pair<KeptBiasRows, KeptBiasRows>> kept_bias;

  int keyframes() const { return static_cast<int>(priors.size()); }
  int shared_size() const;
};

struct RandomChainShape {
  int keyframes = 8;
  int link_size = 15;
  int state_size = kChainStateSize;
  int further_rows = 0;  // of each link
  std::vector<LandmarkRows> cameras = {{11}};
  int landmarks_per_keyframe = 4;
  int max_track = 5;  // keyframes from the first to the last that sees it
  double seen = 0.8;  // of the keyframes within a track
  // Fraction of tracks that are observed once more, from any keyframe after
  // them.
  double found_again = 0;
  // Fraction of kept landmarks; if positive, a state and biases are kept as
  // well.
  double kept = 0;
  bool turned = false;  // each keyframe with every second camera
};

Chain RandomChain(const RandomChainShape& shape, std::mt19937* random);

SharedInformation Eliminate(
    const Chain& chain,
    ChainElimination* elimination,
    ChainElimination::Record record = ChainElimination::Record::kNothing);

// All rows as one matrix; columns: landmarks, states in time order, shared.
struct DenseProblem {
  Eigen::MatrixXd J;
  Eigen::VectorXd r;
};
DenseProblem MakeDense(const Chain& chain);

// Marginal information of the shared columns, by Householder QR in extended
// precision.
SharedInformation DenseReference(const Chain& chain);

}  // namespace selfcal
