#include "core/elimination/chain_record.h"

#include <cstring>

namespace selfcal {

using namespace chain;

void ChainRecord::Start(const ChainLayout& layout,
                        const ChainStructure& structure,
                        bool wanted) {
  wanted_ = wanted;
  columns_ = TransitionColumns(layout.link_size);
  steps_.clear();
  products_.clear();
  transitions_.clear();
  if (!wanted) return;
  // Reserves exactly the memory for the recorded steps.
  const int keyframes = structure.keyframes();
  std::size_t size = 0;
  for (int k = 0; k < keyframes; ++k) {
    const int rest = static_cast<int>(structure.Poses(k).size()) - 1;
    size += static_cast<std::size_t>(kState) * (layout.fixed + rest * kPose);
  }
  steps_.reserve(keyframes);
  products_.reserve(size);
  transitions_.reserve(static_cast<std::size_t>(keyframes - 1) * kState *
                       (columns_.stride + kTransitionNoise));
}

void ChainRecord::Add(const EliminatedState& state,
                      const ChainTransition* link) {
  if (!wanted_) return;
  Step& step = steps_.emplace_back();
  step.product = products_.size();
  step.stride = state.size;
  step.linked = link != nullptr;
  step.transition = transitions_.size();
  if (link != nullptr) {
    transitions_.insert(
        transitions_.end(), link->G, link->G + kState * columns_.stride);
    transitions_.insert(
        transitions_.end(), link->A, link->A + kState * kTransitionNoise);
  }
  std::memcpy(step.root, state.root.root, sizeof(step.root));
  std::memcpy(step.factor, state.root.factor, sizeof(step.factor));
  for (int k = 0; k < kState; ++k) {
    const double* row = state.product.data + k * state.product.stride;
    products_.insert(products_.end(), row, row + state.size);
  }
}

}  // namespace selfcal
