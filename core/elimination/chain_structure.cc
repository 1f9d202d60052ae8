#include "core/elimination/chain_structure.h"

#include <algorithm>
#include <utility>

#include "core/elimination/chain_unknowns.h"

namespace selfcal {
namespace {

constexpr int kNowhere = -1;

}  // namespace

// Counting sort by the first keyframe of each.
void ChainStructure::GroupLandmarks(int keyframe_count,
                                    std::span<const int> tracks,
                                    std::span<const int> keyframes) {
  const int landmarks = static_cast<int>(tracks.size()) - 1;
  landmarks_begin_.assign(keyframe_count + 1, 0);
  for (int m = 0; m < landmarks; ++m) {
    ++landmarks_begin_[keyframes[tracks[m]] + 1];
  }
  for (int k = 0; k < keyframe_count; ++k) {
    landmarks_begin_[k + 1] += landmarks_begin_[k];
  }
  landmarks_.resize(landmarks);
  swaps_.assign(landmarks_begin_.begin(), landmarks_begin_.end() - 1);
  for (int m = 0; m < landmarks; ++m) {
    landmarks_[swaps_[keyframes[tracks[m]]]++] = m;
  }
}

void ChainStructure::Open(int keyframe) {
  if (place_[keyframe] != kNowhere) return;
  place_[keyframe] = static_cast<int>(front_.size());
  front_.push_back(keyframe);
}

void ChainStructure::Find(int keyframe_count,
                          std::span<const int> tracks,
                          std::span<const int> keyframes) {
  GroupLandmarks(keyframe_count, tracks, keyframes);
  slots_of_landmark_.assign(tracks.size() - 1, 0);
  slot_of_observation_.resize(keyframes.size());
  poses_.clear();
  poses_begin_.assign(1, 0);
  swaps_.assign(keyframe_count, 1);
  front_.clear();
  place_.assign(keyframe_count, kNowhere);
  max_slots_ = 0;
  Open(0);
  for (int k = 0; k < keyframe_count; ++k) {
    // front_[k] is the pose of k itself.
    const std::span<int> group(landmarks_.data() + landmarks_begin_[k],
                               landmarks_begin_[k + 1] - landmarks_begin_[k]);
    entering_.clear();
    for (const int m : group) {
      for (int o = tracks[m]; o < tracks[m + 1]; ++o) {
        if (place_[keyframes[o]] == kNowhere) entering_.push_back(keyframes[o]);
      }
    }
    std::sort(entering_.begin(), entering_.end());
    for (const int keyframe : entering_) Open(keyframe);
    for (const int m : group) {
      for (int o = tracks[m]; o < tracks[m + 1]; ++o) {
        slot_of_observation_[o] = place_[keyframes[o]] - k;
        slots_of_landmark_[m] =
            std::max(slots_of_landmark_[m], slot_of_observation_[o] + 1);
      }
    }
    std::sort(group.begin(), group.end(), [&](int a, int b) {
      return std::pair(-slots_of_landmark_[a], a) <
             std::pair(-slots_of_landmark_[b], b);
    });
    if (k + 1 < keyframe_count) {
      Open(k + 1);
      const int place = place_[k + 1];
      swaps_[k] = place - k;
      std::swap(front_[k + 1], front_[place]);
      place_[front_[place]] = place;
      place_[k + 1] = k + 1;
    }
    poses_.insert(poses_.end(), front_.begin() + k, front_.end());
    poses_begin_.push_back(static_cast<int>(poses_.size()));
    max_slots_ = std::max(max_slots_, static_cast<int>(front_.size()) - k);
  }
}

std::size_t ChainStructure::Bytes() const {
  const auto poses_of = [](int slots) {
    return sizeof(double) * kChainPoseSize * static_cast<std::size_t>(slots);
  };
  std::size_t panels = 0;
  for (int k = 0; k < keyframes(); ++k) {
    const std::span<const int> group = Landmarks(k);
    if (group.empty()) continue;
    panels =
        std::max(panels, 3 * group.size() * poses_of(Slots(group.front())));
  }
  return panels + kChainPoseSize * static_cast<std::size_t>(max_slots_) *
                      poses_of(max_slots_);
}

}  // namespace selfcal
