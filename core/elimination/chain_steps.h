// Back-substitution through a chain: from a step of the shared parameters to
// the steps of all states. Internal to core/elimination.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/elimination/chain_record.h"
#include "core/elimination/chain_unknowns.h"

namespace selfcal {

// Shared values at the places of a panel, with zeros for states.
Eigen::VectorXd SharedInPlaces(const EliminatedChain& chain,
                               const Eigen::VectorXd& shared);

// Sets the states that were in the front after the elimination of keyframe k.
void PlaceStates(const EliminatedChain& chain,
                 int k,
                 const std::vector<ChainStateVector>& states,
                 Eigen::VectorXd* z);

// The steps of the states that minimise for a step z, as SharedInPlaces gives
// it.
void FindStateSteps(const EliminatedChain& chain,
                    Eigen::VectorXd z,
                    std::vector<ChainStateVector>* states);

}  // namespace selfcal
