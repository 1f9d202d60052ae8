// The poses that observe each landmark of a chain. Internal to
// core/elimination.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/elimination/chain_shape.h"
#include "core/elimination/chain_structure.h"

namespace selfcal {

class LandmarkViews {
 public:
  struct View {
    int keyframe;
    int slot;  // at the elimination of the landmark
  };

  void Find(const ChainShape& shape, const ChainStructure& structure);

  int landmarks() const { return static_cast<int>(begin_.size()) - 1; }
  // Number of views of all landmarks.
  std::size_t size() const { return views_.size(); }
  // The views of a landmark, by time; and the index of the first of them among
  // those of all landmarks.
  std::span<const View> Of(int landmark) const {
    return {views_.data() + begin_[landmark],
            views_.data() + begin_[landmark + 1]};
  }
  int Begin(int landmark) const { return begin_[landmark]; }

  int LandmarkOf(int observation) const {
    return landmark_of_observation_[observation];
  }
  // Index of the view of an observation among those of its landmark.
  int ViewOf(int observation) const {
    return view_of_observation_[observation] - begin_[LandmarkOf(observation)];
  }

 private:
  std::vector<View> views_;
  std::vector<int> begin_ = {0};
  std::vector<int> landmark_of_observation_, view_of_observation_;
};

}  // namespace selfcal
