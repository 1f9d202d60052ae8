// Sizes and fixed places of unknowns in the front of a chain, and its memory.
// Internal to core/elimination.
#pragma once

#include <cstddef>
#include <cstring>
#include <vector>

#include "core/elimination/chain_transition.h"
#include "core/elimination/chain_unknowns.h"
#include "core/elimination/dense_lanes.h"

namespace selfcal::chain {

inline constexpr int kPose = kChainPoseSize;
inline constexpr int kEliminated = -1;
// The size of a state in whole tiles, at most.
inline constexpr int kMaxTileState = WholeVectors(kMaxChainStateSize);
// Zeros that must follow the valid entries of a panel: the rows of the largest
// tile.
inline constexpr int kZeros = 3 * kPanelPad;

inline constexpr int kPlacesBetweenMoves = 8;

// Separate products of one factor with its pose.
inline constexpr int kOwnPoseStride = WholeVectors(kPose);

// Calls function.operator()<size>() for the size of a state.
template <typename Function>
void WithStateSize(int size, const Function& function) {
  if (size == kChainStateSize) {
    function.template operator()<kChainStateSize>();
  } else {
    function.template operator()<kMaxChainStateSize>();
  }
}

template <typename Number>
void GrowTo(std::size_t size, std::vector<Number>* buffer) {
  if (buffer->size() < size) buffer->resize(size);
}

inline void Zero(double* begin, std::size_t size) {
  std::memset(begin, 0, size * sizeof(double));
}

}  // namespace selfcal::chain
