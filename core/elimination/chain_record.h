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
    double root[chain::kState][16];
    double factor[chain::kState][16];
    bool linked;
    std::size_t transition;  // of its G in the transitions, and A behind it
  };

  // Begins a chain; unless it is `wanted`, nothing will be recorded.
  void Start(const ChainLayout& layout,
             const ChainStructure& structure,
             bool wanted);
  // For each keyframe in turn. A null link: it was eliminated by itself.
  void Add(const EliminatedState& state, const ChainTransition* link);

  bool wanted() const { return wanted_; }
  const Step& step(int k) const { return steps_[k]; }
  // P of a step: 15 rows, `stride` apart.
  const double* Product(const Step& step) const {
    return &products_[step.product];
  }
  // The link of a step that has one.
  ChainTransition Link(const Step& step) const {
    const double* G = &transitions_[step.transition];
    return {columns_, G, G + chain::kState * columns_.stride};
  }

 private:
  bool wanted_ = false;
  TransitionColumns columns_ = TransitionColumns(0);
  std::vector<Step> steps_;
  std::vector<double> products_;
  std::vector<double> transitions_;  // of each link G, then A
};

// A chain whose elimination was recorded.
struct EliminatedChain {
  const ChainLayout& layout;
  const ChainStructure& structure;
  const ChainRecord& record;
};

}  // namespace selfcal
