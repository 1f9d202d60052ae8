// The eliminated states of a chain, as the back-substitution needs them.
// Internal to core/elimination.
#pragma once

#include <cstddef>
#include <vector>

#include "core/elimination/chain_layout.h"
#include "core/elimination/chain_places.h"
#include "core/elimination/chain_structure.h"
#include "core/elimination/chain_transition.h"
#include "core/elimination/state_elimination.h"

namespace selfcal {

class ChainRecord {
 public:
  struct Step {
    std::size_t product;  // of its P in the products
    int stride;
    std::size_t root;  // of its root in the roots, and the factor behind it
    bool linked;
    std::size_t transition;  // of its G in the transitions; A and H follow
    int rows;
  };

  // Begins a chain; unless it is `wanted`, nothing will be recorded.
  void Start(const ChainLayout& layout,
             const ChainStructure& structure,
             bool wanted);
  // For each keyframe in turn. A null link: it was eliminated by itself.
  void Add(const EliminatedState& state, const ChainTransition* link);

  bool wanted() const { return wanted_; }
  const Step& step(int k) const { return steps_[k]; }
  // P of a step: the rows of a state, `stride` apart.
  const double* Product(const Step& step) const {
    return &products_[step.product];
  }
  // The link of a step that has one.
  ChainTransition Link(const Step& step) const {
    const double* G = &transitions_[step.transition];
    const double* A = G + state_ * columns_.stride;
    return {columns_, G, A, step.rows, A + state_ * tile_};
  }
  // Those of StateRoot: the rows of a state, of whole vectors.
  const double* Root(const Step& step) const { return &roots_[step.root]; }
  const double* Factor(const Step& step) const {
    return Root(step) + state_ * tile_;
  }

 private:
  bool wanted_ = false;
  TransitionColumns columns_ = TransitionColumns(0);
  int state_ = 0;              // its size
  int tile_ = 0;               // the same in whole vectors
  std::vector<double> roots_;  // of each step the root, then the factor
  std::vector<Step> steps_;
  std::vector<double> products_;
  std::vector<double> transitions_;  // of each link G, then A and H
};

// A chain whose elimination was recorded.
struct EliminatedChain {
  const ChainLayout& layout;
  const ChainStructure& structure;
  const ChainRecord& record;
};

}  // namespace selfcal
