// The order of ChainElimination: which poses are in the front when a keyframe
// is eliminated, the place of each, and which landmarks are eliminated with it.
// It is determined from the observations alone, without numerical values.
//
// Keyframes are eliminated in their order. A landmark is eliminated when the
// first of the keyframes that observe it is reached. A pose enters the front
// when a landmark that it observes is eliminated, or when its own turn comes,
// and takes the next free place; for tracks without holes along one chain, the
// places are in order of time.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace selfcal {

class ChainStructure {
 public:
  // Landmark m is observed from keyframes[tracks[m]] to
  // keyframes[tracks[m + 1]], ascending (one keyframe may occur several times,
  // once for each camera), at least one.
  void Find(int keyframe_count,
            std::span<const int> tracks,
            std::span<const int> keyframes);

  int keyframes() const { return static_cast<int>(poses_begin_.size()) - 1; }
  int max_slots() const { return max_slots_; }
  // Memory of the elimination for the poses that are in the front at once, and
  // for the landmarks that are eliminated with one keyframe: it grows with the
  // square of the length of the tracks.
  std::size_t Bytes() const;

  // The landmarks that are eliminated with keyframe k, those with most slots
  // first.
  std::span<const int> Landmarks(int k) const {
    return Part(landmarks_, landmarks_begin_, k);
  }
  // Number of slots from the first to the last that observes landmark m.
  int Slots(int m) const { return slots_of_landmark_[m]; }
  // Slot of an observation at the elimination of its landmark.
  int Slot(int observation) const { return slot_of_observation_[observation]; }

  // The keyframes whose poses are in the front when k is eliminated, by slot; k
  // itself has slot 0, and the next one, if there is one, slot 1.
  std::span<const int> Poses(int k) const {
    return Part(poses_, poses_begin_, k);
  }
  // Slot whose pose is swapped with that in slot 1 before k is eliminated and
  // after its landmarks are, to move the next keyframe there.
  int SwapWithNext(int k) const { return swaps_[k]; }

 private:
  static std::span<const int> Part(const std::vector<int>& all,
                                   const std::vector<int>& begin,
                                   int k) {
    return std::span<const int>(all).subspan(begin[k], begin[k + 1] - begin[k]);
  }

  void GroupLandmarks(int keyframe_count,
                      std::span<const int> tracks,
                      std::span<const int> keyframes);
  void Open(int keyframe);

  int max_slots_ = 0;
  std::vector<int> landmarks_, landmarks_begin_;
  std::vector<int> slots_of_landmark_;
  std::vector<int> slot_of_observation_;
  std::vector<int> poses_, poses_begin_;
  std::vector<int> swaps_;
  // Used by Find: the front, without eliminated poses, and the place of each
  // keyframe, counted including eliminated ones.
  std::vector<int> front_;
  std::vector<int> place_;
  std::vector<int> entering_;
};

}  // namespace selfcal
