#include "core/elimination/chain_record.h"

#include <cstring>

namespace selfcal {

using namespace chain;

void ChainRecord::Start(const ChainLayout& layout,
                        const ChainStructure& structure,
                        bool wanted) {
  wanted_ = wanted;
  steps_.clear();
  products_.clear();
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
}

void ChainRecord::Add(const EliminatedState& state,
                      const ChainTransition* link) {
  if (!wanted_) return;
  Step& step = steps_.emplace_back();
  step.product = products_.size();
  step.stride = state.size;
  step.linked = link != nullptr;
  if (link != nullptr) step.link = *link;
  std::memcpy(step.root, state.root.root, sizeof(step.root));
  std::memcpy(step.factor, state.root.factor, sizeof(step.factor));
  for (int k = 0; k < kState; ++k) {
    const double* row = state.product.data + k * state.product.stride;
    products_.insert(products_.end(), row, row + state.size);
  }
}

}  // namespace selfcal
