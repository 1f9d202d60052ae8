#include "core/information/observation_order.h"

namespace selfcal {
namespace {

// Stable counting sort of `order` (of all indices, if it is empty) by a key in
// [0, keys); `begin` gets where each key begins.
template <typename Key>
void SortByKey(std::span<const int> order,
               int size,
               int keys,
               const Key& key,
               std::vector<int>* begin,
               std::vector<int>* sorted) {
  begin->assign(keys + 2, 0);
  for (int i = 0; i < size; ++i) ++(*begin)[key(i) + 2];
  for (int k = 0; k < keys; ++k) (*begin)[k + 2] += (*begin)[k + 1];
  sorted->resize(size);
  for (int i = 0; i < size; ++i) {
    const int index = order.empty() ? i : order[i];
    (*sorted)[(*begin)[key(index) + 1]++] = index;
  }
}

}  // namespace

void ObservationOrder::Find(const MotionSegment& segment, int cameras) {
  const std::vector<Observation>& all = segment.observations;
  const int size = static_cast<int>(all.size());
  SortByKey(
      {},
      size,
      static_cast<int>(segment.keyframes.size()) * cameras,
      [&](int i) { return all[i].keyframe * cameras + all[i].camera; },
      &begin_,
      &by_view_);
  SortByKey(
      by_view_,
      size,
      static_cast<int>(segment.landmarks.size()),
      [&](int i) { return all[i].landmark; },
      &track_begin_,
      &by_landmark_);
}

}  // namespace selfcal
