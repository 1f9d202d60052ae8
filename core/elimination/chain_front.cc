#include "core/elimination/chain_front.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace selfcal {

using namespace chain;

void ChainFront::Start(const ChainLayout& layout,
                       const ChainStructure& structure) {
  fixed_ = layout.fixed;
  first_place_ = 0;
  slots_ = 0;
  const int slots = structure.max_slots();
  // The front advances by one place with each keyframe, and is moved back at
  // its end.
  places_ = std::max(
      places_,
      std::min(structure.keyframes(), slots + slots / 4 + kPlacesBetweenMoves));
  stride_ = fixed_ + places_ * kPose + kZeros;
  GrowTo(static_cast<std::size_t>(stride_) *
             (fixed_ + places_ * kPose + kPanelPad),
         &entries_);
  // Clears only the fixed part: poses are cleared as they enter.
  for (int j = 0; j < fixed_; ++j) Zero(&(*this)(0, j), fixed_ + kPanelPad);
}

// All poses are moved to the first places; every entry moves up or left, so
// that ascending order never overwrites entries that are still to be read.
void ChainFront::MoveBack() {
  ChainFront& front = *this;
  const int from = Pose(0), to = fixed_, size = PosesSize();
  for (int j = 0; j < fixed_; ++j) {
    std::memmove(&front(to, j), &front(from, j), size * sizeof(double));
  }
  for (int j = 0; j < size; ++j) {
    std::memmove(&front(to + j, to + j),
                 &front(from + j, from + j),
                 (size - j) * sizeof(double));
  }
  first_place_ = 0;
}

void ChainFront::OpenSlots(int slots) {
  if (first_place_ + slots > places_) MoveBack();
  for (; slots_ < slots; ++slots_) {
    const int row = Pose(slots_);
    const auto clear = [&](int column) {
      double* entries = &(*this)(row, column);
      for (int i = 0; i < kPose; ++i) entries[i] = 0;
    };
    for (int j = 0; j < fixed_; ++j) clear(j);
    for (int j = Pose(0); j < row + kPose; ++j) clear(j);
  }
}

void ChainFront::SwapPoses(int slot) {
  if (slot == 1) return;
  ChainFront& front = *this;
  const auto entry = [&](int i, int j) -> double& {
    return i >= j ? front(i, j) : front(j, i);
  };
  const int a = Pose(1), b = Pose(slot), end = Pose(slots_);
  for (int n = 0; n < kPose; ++n) {
    // The rest of the front, except the two blocks themselves.
    for (int j = 0; j < end; ++j) {
      if (j >= fixed_ && j < Pose(0)) continue;
      if ((j >= a && j < a + kPose) || (j >= b && j < b + kPose)) continue;
      std::swap(entry(a + n, j), entry(b + n, j));
    }
    for (int j = 0; j <= n; ++j)
      std::swap(front(a + n, a + j), front(b + n, b + j));
    for (int j = 0; j < n; ++j)
      std::swap(front(b + n, a + j), front(b + j, a + n));
  }
}

void ChainFront::CloseSlot() {
  ++first_place_;
  --slots_;
}

}  // namespace selfcal
