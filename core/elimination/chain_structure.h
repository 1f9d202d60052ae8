// The order in which ChainElimination works: which poses are in the front when
// a keyframe is eliminated, where each stands, and which landmarks go with it.
// Found from who sees what alone, without a number.
//
// Keyframes are eliminated in their order. A landmark goes when the first of
// the keyframes that see it is reached. A pose enters the front when a landmark
// that sees it goes, or when its own turn comes, and takes the next free place;
// for tracks without holes along one chain, the places are in order of time.
#pragma once

#include <span>
#include <vector>

namespace selfcal {

class ChainStructure {
 public:
  // Landmark m is seen from keyframes[tracks[m]] to keyframes[tracks[m + 1]],
  // ascending (one keyframe may come several times, once for each camera), at
  // least one.
  void Find(int keyframe_count,
            std::span<const int> tracks,
            std::span<const int> keyframes);

  int keyframes() const { return static_cast<int>(poses_begin_.size()) - 1; }
  int max_slots() const { return max_slots_; }

  // The landmarks that go with keyframe k, those with most slots first.
  std::span<const int> Landmarks(int k) const {
    return Part(landmarks_, landmarks_begin_, k);
  }
  // Slots from the first to the last that sees landmark m.
  int Slots(int m) const { return slots_of_landmark_[m]; }
  // Slot of an observation when its landmark goes.
  int Slot(int observation) const { return slot_of_observation_[observation]; }

  // The keyframes whose poses are in the front when k is eliminated, by slot; k
  // itself has slot 0, and the next one, if there is one, slot 1.
  std::span<const int> Poses(int k) const {
    return Part(poses_, poses_begin_, k);
  }
  // Before k is eliminated, after its landmarks: the slot whose pose changes
  // places with that in slot 1, to bring the next keyframe there.
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
  // While it looks: the front, without what was eliminated, and the place of
  // each keyframe counted with what was.
  std::vector<int> front_;
  std::vector<int> place_;
  std::vector<int> entering_;
};

}  // namespace selfcal
