// The observations that a linear system uses, by landmark and by view, with the
// positions of their landmarks.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/calibration/landmark_position.h"
#include "core/calibration/linear_point.h"

namespace selfcal {

struct LinearObservation {
  int view;  // keyframe * cameras + camera
  int landmark;
  int piece;  // of its track
  Eigen::Vector2d z_px;
  double share = 1;   // weight from screening
  double weight = 0;  // of its rows [1/px]; 0: no information
  double square = 0;  // of its residual, weighted [sigma^2]
  int factor = -1;    // index into the observations of its chain; -1: unused
};

class LinearObservations {
 public:
  // Replaces all observations by those that the point uses, without weights,
  // and reuses the memory.
  void Collect(const LinearPoint& point);

  int cameras() const { return cameras_; }
  int views() const { return static_cast<int>(view_begin_.size()) - 1; }
  int landmarks() const { return static_cast<int>(positions_.size()); }

  std::span<LinearObservation> OfLandmark(int landmark) {
    return std::span(all_).subspan(landmark_begin_[landmark], Count(landmark));
  }
  std::span<const LinearObservation> OfLandmark(int landmark) const {
    return std::span(all_).subspan(landmark_begin_[landmark], Count(landmark));
  }
  // Indices of the observations of a view, by landmark.
  std::span<const int> OfView(int view) const {
    return std::span(by_view_).subspan(
        view_begin_[view], view_begin_[view + 1] - view_begin_[view]);
  }
  LinearObservation& operator[](int index) { return all_[index]; }
  const LinearObservation& operator[](int index) const { return all_[index]; }

  // Position of a landmark, with an inverse depth that is not zero.
  const LandmarkPosition& position(int landmark) const {
    return positions_[landmark];
  }
  // The same as homogeneous points in G, 4 numbers for each landmark.
  const double* points() const { return points_.data(); }

 private:
  int Count(int landmark) const {
    return landmark_begin_[landmark + 1] - landmark_begin_[landmark];
  }
  void PlaceLandmarks(const LinearPoint& point);
  void SortByView(int views);

  int cameras_ = 0;
  std::vector<LinearObservation> all_;  // by landmark
  std::vector<int> landmark_begin_;
  std::vector<int> by_view_, view_begin_;
  std::vector<LandmarkPosition> positions_;
  std::vector<double> points_;
};

}  // namespace selfcal
