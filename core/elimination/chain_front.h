// The remaining system of a chain while it is eliminated: one dense symmetric
// matrix, its front. Internal to core/elimination.
//
// Its fixed part is that of chain_layout.h; behind it are the poses, by the
// slots of ChainStructure. The front advances by one place with each keyframe.
#pragma once

#include <cstddef>
#include <vector>

#include "core/elimination/chain_layout.h"
#include "core/elimination/chain_places.h"
#include "core/elimination/chain_structure.h"
#include "core/elimination/dense_lanes.h"

namespace selfcal {

class ChainFront {
 public:
  // Begins a chain: the fixed part is zero, and there are no poses.
  void Start(const ChainLayout& layout, const ChainStructure& structure);
  // Exchanges memory with the front of a chain that is finished.
  void TakeMemory(ChainFront* finished) { entries_.swap(finished->entries_); }

  // The lower triangle.
  double& operator()(int i, int j) {
    return entries_[static_cast<std::size_t>(j) * stride_ + i];
  }
  Target At(int i, int j) { return {&(*this)(i, j), stride_}; }
  // First place of the pose in a slot.
  int Pose(int slot) const {
    return fixed_ + (first_place_ + slot) * chain::kPose;
  }
  int PosesSize() const { return slots_ * chain::kPose; }

  // Opens slots up to this number, with zeros.
  void OpenSlots(int slots);
  // Swaps the poses in `slot` and in slot 1.
  void SwapPoses(int slot);
  // Removes slot 0: slot 1 becomes slot 0.
  void CloseSlot();

 private:
  void MoveBack();

  std::vector<double> entries_;  // by columns
  int stride_ = 0;
  int fixed_ = 0;
  int places_ = 0;       // there is room for this many poses
  int first_place_ = 0;  // of slot 0
  int slots_ = 0;
};

}  // namespace selfcal
