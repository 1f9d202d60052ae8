#include "core/elimination/landmark_views.h"

#include "core/elimination/chain_places.h"

namespace selfcal {

using namespace chain;

void LandmarkViews::Find(const ChainShape& shape,
                         const ChainStructure& structure) {
  GrowTo(shape.track_keyframes.size(), &landmark_of_observation_);
  GrowTo(shape.track_keyframes.size(), &view_of_observation_);
  views_.clear();
  begin_.assign(1, 0);
  for (std::size_t m = 0; m + 1 < shape.tracks.size(); ++m) {
    for (int o = shape.tracks[m]; o < shape.tracks[m + 1]; ++o) {
      landmark_of_observation_[o] = static_cast<int>(m);
      const int keyframe = shape.track_keyframes[o];
      if (o == shape.tracks[m] || views_.back().keyframe != keyframe) {
        views_.push_back({keyframe, structure.Slot(o)});
      }
      view_of_observation_[o] = static_cast<int>(views_.size()) - 1;
    }
    begin_.push_back(static_cast<int>(views_.size()));
  }
}

}  // namespace selfcal
