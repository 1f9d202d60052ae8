// Back-substitution of covariances through a chain: from that of the shared
// parameters to those of the states and of the noise of the links.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/elimination/chain_record.h"
#include "core/elimination/chain_unknowns.h"
#include "core/simd/vector_width.h"

namespace selfcal {

// Posterior of a chain given all factors, the step and the covariance of the
// shared parameters.
struct ChainPosterior {
  // The noise e of each link, and the residuals H z of its further rows, which
  // are noise as well: minimiser and covariance, between zero and the identity,
  // which is their prior.
  std::vector<ChainNoiseVector> noise;
  std::vector<ChainNoiseMatrix> noise_covariance;
  std::vector<ChainStateMatrix> state_covariance;  // of each keyframe
  // Rows of a state x shared_size(): covariance of the first and of the last
  // keyframe with the shared parameters.
  Eigen::MatrixXd first_with_shared, last_with_shared;
};

// `states` are the steps for the step of the shared parameters.
void FindChainPosterior(const EliminatedChain& chain,
                        VectorWidth width,
                        const Eigen::VectorXd& shared,
                        const Eigen::MatrixXd& shared_covariance,
                        const std::vector<ChainStateVector>& states,
                        ChainPosterior* posterior);

}  // namespace selfcal
