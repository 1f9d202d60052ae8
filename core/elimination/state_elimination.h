// Elimination of the states of a chain, one at a time: by the link to the next,
// or by its own information. Internal to core/elimination.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/elimination/chain_front.h"
#include "core/elimination/chain_layout.h"
#include "core/elimination/chain_places.h"
#include "core/elimination/chain_structure.h"
#include "core/elimination/chain_transition.h"
#include "core/elimination/dense_lanes.h"
#include "core/simd/vector_width.h"

namespace selfcal {

// A L^-T with L L^T = I + A^T S A for a link, S the information of the state;
// L^-T with L L^T = S without.
struct StateRoot {
  using Rows = double[chain::kMaxTileState][chain::kMaxTileState];
  alignas(64) Rows root = {};
  alignas(64) Rows transposed = {};
  Rows factor = {};  // L^T, the upper triangle
};

// A state that was eliminated, in terms of the front that remains.
struct EliminatedState {
  const StateRoot& root;
  ConstPanel product;  // P = root^T Z, rows of the state over the front
  int size;            // of the front
};

class StateElimination {
 public:
  explicit StateElimination(VectorWidth width) : width_(width) {}

  void Start(const ChainLayout& layout, const ChainStructure& structure);
  // Exchanges memory with that of a chain that is finished.
  void TakeMemory(StateElimination* finished);

  // Eliminates the state whose pose has slot 0, which leaves the front. The
  // result is valid until the next call.
  EliminatedState ByLink(const ChainTransition& link, ChainFront* front);
  // By its own information alone.
  EliminatedState ByItself(ChainFront* front);

 private:
  void TakeState(ChainFront* front);
  void Substitute(const ChainTransition& link, ChainFront* front);
  void AddHalf(const ChainTransition& link, ChainFront* front);
  void FindRoot(StateRoot::Rows* M, StateRoot::Rows* panel);
  void FindRootOf(const ChainTransition& link);
  EliminatedState Eliminate(const std::vector<double>& terms,
                            ChainFront* front);
  void AddPosesWithFixed(const ChainTransition& link, ChainFront* front);
  void AddRows(const ChainTransition& link, ChainFront* front) const;

  int state() const { return layout_.state_size(); }
  int tile() const { return WholeVectors(state()); }

  double* Row(std::vector<double>* panel, int k) const {
    return panel->data() + k * panel_stride_;
  }

  VectorWidth width_;
  ChainLayout layout_;
  // The information S of the state, in whole tiles; panels of the rows of the
  // state over the front: coupling Y, Z = Y + S G, P = root^T Z; and Y + S G
  // / 2.
  using Tiles =
      Eigen::Matrix<double, chain::kMaxTileState, chain::kMaxTileState>;
  Tiles information_ = Tiles::Zero();
  StateRoot root_;
  int panel_stride_ = 0;
  std::vector<double> coupling_, substituted_, product_, half_, link_terms_;
};

}  // namespace selfcal
