#include "core/preflight/image_map.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

namespace selfcal {
namespace {

struct Pair {
  Eigen::Vector2d predicted;
  Eigen::Vector2d fed;
};

// One weighted fit; the weight of a pair decreases with its distance from
// `map`.
ImageMap Refit(const std::vector<Pair>& pairs,
               const ImageMap& map,
               double width_px) {
  double weights = 0, squares = 0, products = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean_fed = Eigen::Vector2d::Zero();
  std::vector<double> of(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto& [predicted, fed] = pairs[i];
    const double off =
        (map.scale * predicted + map.shift_px - fed).norm() / width_px;
    of[i] = 1 / (1 + off * off);
    weights += of[i];
    mean += of[i] * predicted;
    mean_fed += of[i] * fed;
  }
  mean /= weights;
  mean_fed /= weights;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector2d predicted = pairs[i].predicted - mean;
    squares += of[i] * predicted.squaredNorm();
    products += of[i] * predicted.dot(pairs[i].fed - mean_fed);
  }
  ImageMap next;
  next.scale = products / squares;
  next.shift_px = mean_fed - next.scale * mean;
  return next;
}

}  // namespace

ImageMap FitImageMap(const std::vector<View>& views,
                     const CameraCalibration& camera) {
  constexpr int kIterations = 12;
  constexpr std::size_t kMinPairs = 20;
  // Predictions of points at the edge of the model's range are meaningless.
  const double range_px = 4.0 * (camera.width_px + camera.height_px);
  std::vector<Pair> pairs;
  for (const View& view : views) {
    const auto z = Predict(camera, view.pose, view.p);
    if (z && z->norm() < range_px) pairs.push_back({*z, view.z_px});
  }
  ImageMap map;
  map.error = {HUGE_VAL, 0};
  if (pairs.size() < kMinPairs) return map;
  // The width decreases, so that the fit converges from a distant start.
  double width_px = range_px;
  for (int n = 0; n < kIterations; ++n, width_px = std::max(width_px / 2, 2.)) {
    const ImageMap next = Refit(pairs, map, width_px);
    if (!std::isfinite(next.scale) || !next.shift_px.allFinite()) return map;
    map = next;
  }
  std::vector<double> errors;
  for (const View& view : views) {
    const auto z = Predict(camera, view.pose, view.p);
    errors.push_back(z ? (map.scale * *z + map.shift_px - view.z_px).norm()
                       : HUGE_VAL);
  }
  map.error = Summarise(std::move(errors));
  return map;
}

}  // namespace selfcal
