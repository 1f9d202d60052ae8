#include "core/elimination/chain_record.h"

#include <algorithm>

namespace selfcal {

using namespace chain;

void ChainRecord::Start(const ChainLayout& layout,
                        const ChainStructure& structure,
                        bool wanted) {
  wanted_ = wanted;
  columns_ = layout.columns();
  state_ = layout.state_size();
  tile_ = WholeVectors(state_);
  roots_.clear();
  steps_.clear();
  products_.clear();
  transitions_.clear();
  if (!wanted) return;
  // Reserves exactly the memory for the recorded steps.
  const int keyframes = structure.keyframes();
  std::size_t size = 0;
  for (int k = 0; k < keyframes; ++k) {
    const int rest = static_cast<int>(structure.Poses(k).size()) - 1;
    size += static_cast<std::size_t>(state_) * (layout.fixed + rest * kPose);
  }
  steps_.reserve(keyframes);
  products_.reserve(size);
  roots_.reserve(static_cast<std::size_t>(keyframes) * 2 * state_ * tile_);
  const int rows =
      state_ > kChainStateSize ? kMaxChainLinkRows : 0;  // of a link
  transitions_.reserve(
      static_cast<std::size_t>(keyframes - 1) *
      (state_ * (columns_.stride + tile_) + rows * columns_.stride));
}

void ChainRecord::Add(const EliminatedState& state,
                      const ChainTransition* link) {
  if (!wanted_) return;
  Step& step = steps_.emplace_back();
  step.product = products_.size();
  step.stride = state.size;
  step.linked = link != nullptr;
  step.transition = transitions_.size();
  step.rows = link != nullptr ? link->rows : 0;
  if (link != nullptr) {
    const auto add = [&](const double* rows, int size) {
      transitions_.insert(transitions_.end(), rows, rows + size);
    };
    add(link->G, state_ * columns_.stride);
    add(link->A, state_ * tile_);
    if (link->rows > 0) add(link->H, link->rows * columns_.stride);
  }
  step.root = roots_.size();
  for (const auto* rows : {&state.root.root, &state.root.factor}) {
    for (int i = 0; i < state_; ++i) {
      roots_.insert(roots_.end(), (*rows)[i], (*rows)[i] + tile_);
    }
  }
  for (int k = 0; k < state_; ++k) {
    const double* row = state.product.data + k * state.product.stride;
    products_.insert(products_.end(), row, row + state.size);
  }
}

}  // namespace selfcal
