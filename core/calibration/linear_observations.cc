#include "core/calibration/linear_observations.h"

#include <cmath>

namespace selfcal {
namespace {

// The modelled distance of a landmark is at most 1 / this [m].
constexpr double kLeastAbsInverseDepth = 1e-9;

double UsedInverseDepth(const LandmarkPosition& position) {
  const double rho = position.inverse_depth.z();
  return std::abs(rho) < kLeastAbsInverseDepth ? kLeastAbsInverseDepth : rho;
}

}  // namespace

void LinearObservations::PlaceLandmarks(const LinearPoint& point) {
  points_.resize(4 * point.landmarks.size());
  positions_.clear();
  for (std::size_t i = 0; i < point.landmarks.size(); ++i) {
    LandmarkPosition position = point.landmarks[i].position;
    position.inverse_depth.z() = UsedInverseDepth(position);
    Eigen::Vector4d::Map(&points_[4 * i]) = position.Homogeneous();
    positions_.push_back(position);
  }
}

void LinearObservations::SortByView(int views) {
  view_begin_.assign(views + 2, 0);
  for (const LinearObservation& seen : all_) ++view_begin_[seen.view + 2];
  for (std::size_t v = 2; v < view_begin_.size(); ++v) {
    view_begin_[v] += view_begin_[v - 1];
  }
  by_view_.resize(all_.size());
  for (std::size_t i = 0; i < all_.size(); ++i) {
    by_view_[view_begin_[all_[i].view + 1]++] = static_cast<int>(i);
  }
  view_begin_.pop_back();
}

void LinearObservations::Collect(const LinearPoint& point) {
  cameras_ = static_cast<int>(point.thetas[0].cameras.size());
  PlaceLandmarks(point);
  std::size_t count = 0;
  for (const ScreenedLandmark& landmark : point.landmarks) {
    count += landmark.used.size();
  }
  all_.clear();
  all_.reserve(count);
  landmark_begin_.assign(1, 0);
  for (std::size_t i = 0; i < point.landmarks.size(); ++i) {
    const ScreenedLandmark& landmark = point.landmarks[i];
    const Track& track = point.problem.tracks[landmark.track];
    for (const UsedObservation& used : landmark.used) {
      const TrackObservation& o = track.observations[used.index];
      all_.push_back({.view = o.keyframe * cameras_ + o.camera,
                      .landmark = static_cast<int>(i),
                      .piece = PieceOf(track, used.index),
                      .z_px = o.z_px,
                      .share = landmark.weight * used.weight});
    }
    landmark_begin_.push_back(static_cast<int>(all_.size()));
  }
  SortByView(static_cast<int>(point.keyframes.size()) * cameras_);
}

}  // namespace selfcal
