#include "core/initialisation/image_rays.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "core/model/median.h"

namespace selfcal {
namespace {

// Images further apart than this are not compared.
constexpr double kMaxInterval_s = 0.5;
// Step of the derivative with respect to the logarithm of the focal scale.
constexpr double kScaleStep = 1e-4;

CameraCalibration Scaled(const CameraCalibration& camera, double scale) {
  CameraCalibration scaled = camera;
  scaled.f *= scale;
  return scaled;
}

std::vector<std::pair<int, int>> Matches(const RayImage& a, const RayImage& b) {
  std::vector<std::pair<int, int>> matches;
  std::size_t j = 0;
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    const ImagePoint& point = a.points[i];
    while (j < b.points.size() && b.points[j].landmark < point.landmark) ++j;
    if (j == b.points.size()) break;
    if (b.points[j].landmark != point.landmark || point.ray_C.isZero() ||
        b.points[j].ray_C.isZero()) {
      continue;
    }
    matches.emplace_back(static_cast<int>(i), static_cast<int>(j));
  }
  return matches;
}

// Median angle, nearly, by which points move.
double Flow(const RayImage& a,
            const RayImage& b,
            const std::vector<std::pair<int, int>>& matches) {
  std::vector<double> flows;
  for (const auto& [i, j] : matches) {
    flows.push_back((b.points[j].ray_C - a.points[i].ray_C).norm());
  }
  return UpperMedian(std::move(flows));
}

}  // namespace

RayImages::RayImages(const CameraCalibration& camera,
                     std::span<const TrackedImage> images,
                     std::int64_t origin_ns)
    : start_(camera), camera_(camera) {
  for (const TrackedImage& image : images) {
    RayImage rays{1e-9 * static_cast<double>(image.t_ns - origin_ns), {}};
    if (!images_.empty() && !(rays.t_s > images_.back().t_s)) continue;
    for (const TrackedPoint& point : image.points) {
      if (!point.z_px.allFinite()) continue;
      rays.points.push_back({point.landmark,
                             point.z_px,
                             Eigen::Vector3d::Zero(),
                             Eigen::Vector3d::Zero()});
    }
    std::ranges::stable_sort(rays.points, {}, &ImagePoint::landmark);
    const auto repeated =
        std::unique(rays.points.begin(),
                    rays.points.end(),
                    [](const ImagePoint& a, const ImagePoint& b) {
                      return a.landmark == b.landmark;
                    });
    rays.points.erase(repeated, rays.points.end());
    images_.push_back(std::move(rays));
  }
  SetFocalScale(1);
}

void RayImages::SetFocalScale(double scale) {
  focal_scale_ = scale;
  camera_ = Scaled(start_, scale);
  const CameraCalibration longer = Scaled(camera_, std::exp(kScaleStep));
  const CameraCalibration shorter = Scaled(camera_, std::exp(-kScaleStep));
  for (RayImage& image : images_) {
    for (ImagePoint& point : image.points) {
      Eigen::Vector3d narrow, wide;
      if (!Unproject(camera_, point.z_px, &point.ray_C) ||
          !Unproject(longer, point.z_px, &narrow) ||
          !Unproject(shorter, point.z_px, &wide)) {
        point.ray_C.setZero();
        continue;
      }
      point.by_scale = (narrow - wide) / (2 * kScaleStep);
    }
  }
}

void RayImages::AddNoise(double sigma_px, std::uint64_t seed) {
  // Uniform numbers have the same bits on every standard library.
  std::mt19937_64 engine(seed);
  const auto error_px = [&] {
    const double unit = std::ldexp(static_cast<double>(engine() >> 11), -53);
    return sigma_px * std::sqrt(12.0) * (unit - 0.5);
  };
  for (RayImage& image : images_) {
    for (ImagePoint& point : image.points) {
      point.z_px.x() += error_px();
      point.z_px.y() += error_px();
    }
  }
  SetFocalScale(focal_scale_);
}

double RayImages::px_per_rad() const { return PixelsPerRadian(camera_).mean(); }

std::vector<ImagePair> ChainPairs(const std::vector<RayImage>& images,
                                  double interval_s,
                                  double flow_rad) {
  std::vector<ImagePair> pairs;
  std::size_t from = 0;
  while (from + 1 < images.size()) {
    const RayImage& a = images[from];
    std::size_t to = from + 1;
    std::vector<std::pair<int, int>> matches = Matches(a, images[to]);
    for (std::size_t next = to + 1; next < images.size(); ++next) {
      const double dt_s = images[next].t_s - a.t_s;
      if (dt_s > kMaxInterval_s) break;
      if (dt_s > interval_s && Flow(a, images[to], matches) >= flow_rad) break;
      std::vector<std::pair<int, int>> more = Matches(a, images[next]);
      if (more.size() < kMinMatches || 2 * more.size() < a.points.size()) break;
      matches = std::move(more);
      to = next;
    }
    if (matches.size() >= kMinMatches &&
        images[to].t_s - a.t_s <= kMaxInterval_s) {
      pairs.push_back(
          {static_cast<int>(from), static_cast<int>(to), std::move(matches)});
    }
    from = to;
  }
  if (pairs.size() <= kMaxPairs) return pairs;
  std::vector<ImagePair> kept;
  for (std::size_t n = 0; n < kMaxPairs; ++n) {
    kept.push_back(std::move(pairs[n * pairs.size() / kMaxPairs]));
  }
  return kept;
}

}  // namespace selfcal
