#include "core/information/inliers.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <tuple>

#include "core/factor/reprojection.h"
#include "core/information/refine_landmark.h"

namespace selfcal {
namespace {

// Median of the norm of a two-dimensional normal vector of unit sigma.
constexpr double kMedianOfRayleigh = 1.1774100225154747;
constexpr double kManyOutliers = 0.2;
constexpr double kNotProjectable = -1;

std::vector<int> SortedObservations(const MotionSegment& segment) {
  std::vector<int> order(segment.observations.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    const Observation& x = segment.observations[a];
    const Observation& y = segment.observations[b];
    return std::tie(x.landmark, x.keyframe, x.camera) <
           std::tie(y.landmark, y.keyframe, y.camera);
  });
  return order;
}

// Calls visit(landmark, observations of it) in the order of the landmarks.
template <typename Visit>
void ForEachTrack(const MotionSegment& segment,
                  std::span<const int> sorted,
                  Visit visit) {
  for (std::size_t begin = 0; begin < sorted.size();) {
    const int landmark = segment.observations[sorted[begin]].landmark;
    std::size_t end = begin + 1;
    while (end < sorted.size() &&
           segment.observations[sorted[end]].landmark == landmark) {
      ++end;
    }
    visit(landmark, sorted.subspan(begin, end - begin));
    begin = end;
  }
}

// Norm of the residual [px], or kNotProjectable.
double ResidualNorm(const Calibration& theta0,
                    const MotionSegment& segment,
                    const Observation& observation,
                    const Eigen::Vector3d& p_G) {
  const KeyframeState& x = segment.keyframes[observation.keyframe];
  Eigen::Vector2d r;
  return Reproject(x.q_GI,
                   x.p_GI,
                   theta0.cameras[observation.camera],
                   p_G.homogeneous(),
                   observation.z_px,
                   &r,
                   nullptr)
             ? r.norm()
             : kNotProjectable;
}

// Zero where nothing projects.
double MedianOfProjected(std::vector<double> norms) {
  std::erase(norms, kNotProjectable);
  if (norms.empty()) return 0;
  const auto middle = norms.begin() + norms.size() / 2;
  std::nth_element(norms.begin(), middle, norms.end());
  return *middle;
}

}  // namespace

InlierSelection SelectInliers(const Calibration& theta0,
                              double pixel_sigma_px,
                              const MotionSegment& segment,
                              const ScoreOptions& options) {
  InlierSelection result;
  for (const Landmark& landmark : segment.landmarks) {
    result.landmarks.push_back(landmark.p_G);
  }
  const std::vector<int> sorted = SortedObservations(segment);
  std::vector<double> norms(segment.observations.size());
  ForEachTrack(segment, sorted, [&](int landmark, std::span<const int> track) {
    Eigen::Vector3d& p_G = result.landmarks[landmark];
    p_G = RefineLandmark(theta0, pixel_sigma_px, segment, track, p_G);
    for (const int index : track) {
      norms[index] =
          ResidualNorm(theta0, segment, segment.observations[index], p_G);
    }
  });

  ResidualStatistics& statistics = result.statistics;
  statistics.observations = static_cast<int>(sorted.size());
  statistics.landmarks = static_cast<int>(segment.landmarks.size());
  statistics.reprojection_median_px = MedianOfProjected(norms);
  const double gate_px =
      options.outlier_gate *
      std::max(pixel_sigma_px,
               statistics.reprojection_median_px / kMedianOfRayleigh);
  double sum_of_squares = 0;
  ForEachTrack(segment, sorted, [&](int, std::span<const int> track) {
    std::vector<int> good;
    for (const int index : track) {
      if (norms[index] == kNotProjectable) {
        ++statistics.not_projectable;
      } else if (!(norms[index] <= gate_px)) {
        ++statistics.outliers;
      } else {
        good.push_back(index);
      }
    }
    if (good.size() < 2) return;
    ++statistics.landmarks_used;
    for (const int index : good) sum_of_squares += norms[index] * norms[index];
    result.inliers.insert(result.inliers.end(), good.begin(), good.end());
  });
  statistics.inliers = static_cast<int>(result.inliers.size());
  if (statistics.inliers > 0) {
    statistics.reprojection_rms_px =
        std::sqrt(sum_of_squares / statistics.inliers);
  }
  statistics.many_outliers = statistics.observations - statistics.inliers >
                             kManyOutliers * statistics.observations;
  return result;
}

}  // namespace selfcal
