#include "client/tracking/feature_tracker.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace selfcal::client {
namespace {

// A change of brightness below this is left to the tracker.
constexpr double kBrightnessTolerance = 0.01;
// Cameras nearer to each other than this have no parallax to check.
constexpr double kMinBaseline_m = 1e-3;

Eigen::Vector2d AsVector(const cv::Point2f& z) { return {z.x, z.y}; }

bool IsInside(const CameraCalibration& camera,
              const cv::Point2f& z,
              double border_px) {
  return z.x >= border_px && z.y >= border_px &&
         z.x <= camera.width_px - 1 - border_px &&
         z.y <= camera.height_px - 1 - border_px;
}

// Keeps the elements whose mark is set.
template <typename T>
void Keep(const std::vector<char>& marks, std::vector<T>* values) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if (marks[i]) (*values)[kept++] = (*values)[i];
  }
  values->resize(kept);
}

}  // namespace

FeatureTracker::FeatureTracker(const Calibration& theta,
                               const TrackerOptions& options)
    : options_(options), gyro_(theta.imu, options.b_g) {
  for (std::size_t j = 0; j < theta.cameras.size(); ++j) {
    const CameraCalibration& c = theta.cameras[j];
    Camera camera;
    camera.theta = c;
    camera.origin_I = -(c.q_CI.conjugate() * c.p_CI);
    camera.px_per_rad = PixelsPerRadian(c).mean();
    camera.line_delay_s =
        j < options.line_delays_s.size() ? options.line_delays_s[j] : 0;
    cameras_.push_back(std::move(camera));
  }
}

std::vector<TrackPoint> FeatureTracker::Track(
    std::int64_t t_ns, const std::vector<cv::Mat>& images) {
  counts_ = {};
  std::vector<char> present(cameras_.size(), 0);
  double earliest_s = static_cast<double>(t_ns) * 1e-9;
  for (std::size_t j = 0; j < cameras_.size() && j < images.size(); ++j) {
    const CameraCalibration& c = cameras_[j].theta;
    if (images[j].type() != CV_8UC1 || images[j].cols != c.width_px ||
        images[j].rows != c.height_px) {
      continue;
    }
    present[j] = 1;
    Follow(static_cast<int>(j),
           images[j],
           static_cast<double>(t_ns) * 1e-9 + c.time_offset_s);
  }
  for (std::size_t a = 0; a < cameras_.size(); ++a) {
    if (present[a]) Replenish(static_cast<int>(a), present);
  }
  for (std::size_t a = 0; a < cameras_.size(); ++a) {
    for (std::size_t b = a + 1; b < cameras_.size(); ++b) {
      if (present[a] && present[b]) CheckStereo(&cameras_[a], &cameras_[b]);
    }
  }
  std::vector<TrackPoint> points;
  for (std::size_t j = 0; j < cameras_.size(); ++j) {
    if (!cameras_[j].image.empty()) {
      earliest_s = std::min(earliest_s, cameras_[j].t_s);
    }
    if (!present[j]) continue;
    for (const Point& point : cameras_[j].points) {
      points.push_back(
          {point.landmark, static_cast<int>(j), images_, AsVector(point.z_px)});
    }
  }
  gyro_.DropBefore(earliest_s);
  ++images_;
  return points;
}

std::optional<Eigen::Vector3d> FeatureTracker::RayOf(const Camera& camera,
                                                     const cv::Point2f& z_px,
                                                     double t_s) const {
  Eigen::Vector3d ray_C;
  if (!Unproject(camera.theta, AsVector(z_px), &ray_C)) return std::nullopt;
  Eigen::Vector3d ray_I = camera.theta.q_CI.conjugate() * ray_C;
  if (camera.line_delay_s != 0) {
    ray_I = gyro_.Between(t_s, t_s + z_px.y * camera.line_delay_s) * ray_I;
  }
  return ray_I;
}

std::optional<cv::Point2f> FeatureTracker::PixelOf(const Camera& camera,
                                                   const Eigen::Vector3d& ray_I,
                                                   double row_delay_s,
                                                   double t_s) const {
  const Eigen::Quaterniond q = row_delay_s == 0
                                   ? Eigen::Quaterniond::Identity()
                                   : gyro_.Between(t_s + row_delay_s, t_s);
  Eigen::Vector2d z_px;
  if (!Project(camera.theta, camera.theta.q_CI * (q * ray_I), &z_px, nullptr)) {
    return std::nullopt;
  }
  return cv::Point2f(static_cast<float>(z_px.x()),
                     static_cast<float>(z_px.y()));
}

void FeatureTracker::Follow(int camera, const cv::Mat& image, double t_s) {
  Camera& c = cameras_[static_cast<std::size_t>(camera)];
  Pyramid next = BuildPyramid(image, options_.flow);
  std::vector<cv::Point2f> before;
  std::vector<cv::Point2f> found;
  if (!c.image.empty()) {
    const Eigen::Quaterniond q_10 = gyro_.Between(t_s, c.t_s);
    for (const Point& point : c.points) {
      before.push_back(point.z_px);
      // The row of the prediction is nearly that of the point itself.
      const auto ray_I = RayOf(c, point.z_px, c.t_s);
      const auto pixel =
          ray_I ? PixelOf(c, q_10 * *ray_I, point.z_px.y * c.line_delay_s, t_s)
                : std::nullopt;
      found.push_back(pixel.value_or(point.z_px));
    }
    const double ratio =
        BrightnessRatio(c.image, image, before, found, options_.flow.window_px);
    if (std::abs(ratio - 1) > kBrightnessTolerance) {
      cv::Mat scaled;
      c.image.convertTo(scaled, CV_8U, ratio);
      c.pyramid = BuildPyramid(scaled, options_.flow);
    }
    std::vector<char> kept =
        FollowPatches(c.pyramid, next, before, options_.flow, &found);
    counts_.followed += static_cast<int>(before.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      kept[i] = kept[i] &&
                IsInside(c.theta, found[i], options_.corners.border_px / 2.0);
      if (!kept[i]) ++counts_.lost;
      c.points[i].z_px = found[i];
    }
    Keep(kept, &before);
    Keep(kept, &c.points);
  }
  const double before_s = c.t_s;
  c.t_s = t_s;
  c.image = image.clone();
  c.pyramid = std::move(next);
  if (options_.check_epipolar) CheckMotion(&c, before, before_s);
}

void FeatureTracker::CheckMotion(Camera* camera,
                                 const std::vector<cv::Point2f>& before,
                                 double before_s) {
  std::vector<RayPair> pairs;
  std::vector<char> kept(before.size(), 1);
  std::vector<std::size_t> index;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const auto a = RayOf(*camera, before[i], before_s);
    const auto b = RayOf(*camera, camera->points[i].z_px, camera->t_s);
    kept[i] = a && b;
    if (!kept[i]) continue;
    pairs.push_back({*a, *b});
    index.push_back(i);
  }
  EpipolarOptions options;
  options.px_per_rad = camera->px_per_rad;
  options.max_distance_px = options_.max_epipolar_px;
  options.seed = static_cast<std::uint64_t>(images_) + 1;
  const EpipolarFit fit =
      CheckEpipolar(pairs, gyro_.Between(camera->t_s, before_s), options);
  for (std::size_t n = 0; n < index.size(); ++n) {
    kept[index[n]] = fit.inliers[n];
  }
  counts_.rejected +=
      static_cast<int>(std::count(kept.begin(), kept.end(), char{0}));
  Keep(kept, &camera->points);
}

void FeatureTracker::Replenish(int camera, const std::vector<char>& present) {
  Camera& c = cameras_[static_cast<std::size_t>(camera)];
  const int room = options_.max_tracks - static_cast<int>(c.points.size());
  if (room <= 0) return;
  std::vector<cv::Point2f> taken;
  for (const Point& point : c.points) taken.push_back(point.z_px);
  const std::vector<cv::Point2f> corners =
      FindCorners(c.image, taken, options_.corners);
  const std::size_t first = c.points.size();
  for (const cv::Point2f& corner : corners) {
    if (static_cast<int>(c.points.size()) >= options_.max_tracks) break;
    c.points.push_back({next_landmark_++, corner});
    ++counts_.begun;
  }
  for (std::size_t j = 0; j < cameras_.size(); ++j) {
    if (present[j] && static_cast<int>(j) != camera) {
      MatchNew(c, first, &cameras_[j]);
    }
  }
}

void FeatureTracker::MatchNew(const Camera& from,
                              std::size_t first,
                              Camera* to) {
  const double step_s = to->t_s - from.t_s;
  const Eigen::Quaterniond q = step_s == 0 ? Eigen::Quaterniond::Identity()
                                           : gyro_.Between(to->t_s, from.t_s);
  std::vector<Point> open(
      from.points.begin() + static_cast<std::ptrdiff_t>(first),
      from.points.end());
  for (const double distance_m : options_.stereo_distances_m) {
    std::vector<cv::Point2f> points;
    std::vector<cv::Point2f> found;
    std::vector<std::size_t> index;
    for (std::size_t i = 0; i < open.size(); ++i) {
      const auto ray_I = RayOf(from, open[i].z_px, from.t_s);
      if (!ray_I) continue;
      const Eigen::Vector3d p_I =
          q * (distance_m * *ray_I + from.origin_I) - to->origin_I;
      const auto pixel =
          PixelOf(*to, p_I, open[i].z_px.y * to->line_delay_s, to->t_s);
      if (!pixel || !IsInside(to->theta, *pixel, options_.corners.border_px)) {
        continue;
      }
      points.push_back(open[i].z_px);
      found.push_back(*pixel);
      index.push_back(i);
    }
    const std::vector<char> ok =
        FollowPatches(from.pyramid, to->pyramid, points, options_.flow, &found);
    std::vector<char> still_open(open.size(), 1);
    for (std::size_t n = 0; n < ok.size(); ++n) {
      if (!ok[n] ||
          !IsInside(to->theta, found[n], options_.corners.border_px)) {
        continue;
      }
      still_open[index[n]] = 0;
      const bool apart = std::all_of(
          to->points.begin(), to->points.end(), [&](const Point& other) {
            return cv::norm(other.z_px - found[n]) >=
                   options_.corners.min_distance_px / 2;
          });
      if (!apart ||
          static_cast<int>(to->points.size()) >= options_.max_tracks) {
        continue;
      }
      to->points.push_back({open[index[n]].landmark, found[n]});
      ++counts_.stereo_found;
    }
    Keep(still_open, &open);
  }
}

void FeatureTracker::CheckStereo(Camera* a, Camera* b) {
  const Eigen::Vector3d t_I = a->origin_I - b->origin_I;
  if (!options_.check_epipolar || t_I.norm() < kMinBaseline_m) return;
  std::unordered_map<std::uint64_t, std::size_t> in_a;
  for (std::size_t i = 0; i < a->points.size(); ++i) {
    in_a[a->points[i].landmark] = i;
  }
  std::vector<RayPair> pairs;
  std::vector<std::size_t> index;
  for (std::size_t i = 0; i < b->points.size(); ++i) {
    const auto match = in_a.find(b->points[i].landmark);
    if (match == in_a.end()) continue;
    const auto ray_a = RayOf(*a, a->points[match->second].z_px, a->t_s);
    const auto ray_b = RayOf(*b, b->points[i].z_px, b->t_s);
    if (!ray_a || !ray_b) continue;
    pairs.push_back({*ray_a, *ray_b});
    index.push_back(i);
  }
  EpipolarOptions options;
  options.px_per_rad = std::min(a->px_per_rad, b->px_per_rad);
  options.max_distance_px = options_.max_stereo_px;
  const EpipolarFit fit =
      CheckEpipolar(pairs, gyro_.Between(b->t_s, a->t_s), options, t_I);
  std::vector<char> kept(b->points.size(), 1);
  for (std::size_t n = 0; n < index.size(); ++n) {
    kept[index[n]] = fit.inliers[n];
    if (!fit.inliers[n]) ++counts_.stereo_rejected;
  }
  Keep(kept, &b->points);
}

}  // namespace selfcal::client
