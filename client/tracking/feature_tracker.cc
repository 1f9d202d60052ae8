#include "client/tracking/feature_tracker.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <unordered_map>
#include <unordered_set>
#include <utility>

namespace selfcal::client {
namespace {

// A change of brightness below this is left to the tracker.
constexpr double kBrightnessTolerance = 0.01;
// Cameras nearer to each other than this have no parallax to check.
constexpr double kMinBaseline_m = 1e-3;
// A point that another camera did not find is looked for again after so many
// images.
constexpr std::uint64_t kMatchAgain = 10;
// Smoothing of the images in which patches are aligned.
constexpr double kSmoothing_px = 0.8;
// A patch that appears larger or smaller by more begins anew.
constexpr double kMaxStretch = 1.8;
// Step of the derivatives of warps.
constexpr double kDifference_px = 2;
// Distance from the border of points that are followed, and of new patches.
constexpr double kFlowBorder_px = 4;
constexpr double kPatchBorder_px = PatchTemplate::kReach_px + 3;

Eigen::Vector2d AsVector(const cv::Point2f& z) { return {z.x, z.y}; }

cv::Point2f AsPoint(const Eigen::Vector2d& z) {
  return {static_cast<float>(z.x()), static_cast<float>(z.y())};
}

bool IsInside(const cv::Mat& image, const cv::Point2f& z, double border_px) {
  return z.x >= border_px && z.y >= border_px &&
         z.x <= static_cast<float>(image.cols - 1 - border_px) &&
         z.y <= static_cast<float>(image.rows - 1 - border_px);
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
  for (const CameraCalibration& c : theta.cameras) {
    Camera camera;
    camera.theta = c;
    camera.origin_I = -(c.q_CI.conjugate() * c.p_CI);
    camera.px_per_rad = PixelsPerRadian(c).mean();
    camera.line_delay_s = c.line_delay_s.value_or(0);
    canvas_.width = std::max(canvas_.width, c.width_px);
    canvas_.height = std::max(canvas_.height, c.height_px);
    cameras_.push_back(std::move(camera));
  }
}

Pyramid FeatureTracker::PyramidOf(const cv::Mat& image) const {
  if (image.size() == canvas_) return BuildPyramid(image, options_.flow);
  cv::Mat padded;
  cv::copyMakeBorder(image,
                     padded,
                     0,
                     canvas_.height - image.rows,
                     0,
                     canvas_.width - image.cols,
                     cv::BORDER_REPLICATE);
  return BuildPyramid(padded, options_.flow);
}

std::vector<TrackPoint> FeatureTracker::Track(
    std::int64_t t_ns, const std::vector<cv::Mat>& images) {
  counts_ = {};
  std::vector<char> present(cameras_.size(), 0);
  double earliest_s = static_cast<double>(t_ns) * 1e-9;
  if (!options_.session_start_ns) options_.session_start_ns = t_ns;
  const double session_s =
      1e-9 * static_cast<double>(t_ns - *options_.session_start_ns);
  for (std::size_t j = 0; j < cameras_.size() && j < images.size(); ++j) {
    const CameraCalibration& c = cameras_[j].theta;
    if (images[j].type() != CV_8UC1 || images[j].cols != c.width_px ||
        images[j].rows != c.height_px) {
      continue;
    }
    present[j] = 1;
    Follow(static_cast<int>(j),
           images[j],
           static_cast<double>(t_ns) * 1e-9 + TimeOffsetAt(c, session_s));
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

std::optional<Eigen::Vector3d> FeatureTracker::RayOf(
    const Camera& camera, const Eigen::Vector2d& z_px, double t_s) const {
  Eigen::Vector3d ray_C;
  if (!Unproject(camera.theta, z_px, &ray_C)) return std::nullopt;
  Eigen::Vector3d ray_I = camera.theta.q_CI.conjugate() * ray_C;
  if (camera.line_delay_s != 0) {
    ray_I = gyro_.Between(t_s, t_s + z_px.y() * camera.line_delay_s) * ray_I;
  }
  return ray_I;
}

std::optional<Eigen::Vector2d> FeatureTracker::Transfer(
    const Camera& from,
    const Eigen::Vector2d& z_px,
    const Camera& to,
    double to_s,
    std::optional<double> distance_m) const {
  const auto ray_I = RayOf(from, z_px, from.t_s);
  if (!ray_I) return std::nullopt;
  // The row of the result is nearly that of the pixel itself.
  const double row_s = to_s + z_px.y() * to.line_delay_s;
  const Eigen::Quaterniond q = gyro_.Between(row_s, from.t_s);
  const Eigen::Vector3d p_I =
      distance_m ? q * (*distance_m * *ray_I + from.origin_I) - to.origin_I
                 : q * *ray_I;
  Eigen::Vector2d pixel;
  if (!Project(to.theta, to.theta.q_CI * p_I, &pixel, nullptr)) {
    return std::nullopt;
  }
  return pixel;
}

bool FeatureTracker::TransferWarp(const Camera& from,
                                  const Point& point,
                                  const Camera& to,
                                  double to_s,
                                  std::optional<double> distance_m,
                                  PatchWarp* warp) const {
  const Eigen::Vector2d z_px = AsVector(point.z_px);
  const auto centre = Transfer(from, z_px, to, to_s, distance_m);
  if (!centre) return false;
  Eigen::Matrix2d J;
  for (int axis = 0; axis < 2; ++axis) {
    const Eigen::Vector2d beside =
        z_px + kDifference_px * Eigen::Vector2d::Unit(axis);
    const auto pixel = Transfer(from, beside, to, to_s, distance_m);
    if (!pixel) return false;
    J.col(axis) = (*pixel - *centre) / kDifference_px;
  }
  *warp = {J * point.A, *centre};
  return true;
}

PatchPlane FeatureTracker::PlaneOf(const Camera& camera,
                                   const Eigen::Vector2d& z_px,
                                   double t_s) const {
  auto q_0C = gyro_.OrientationAt(t_s + z_px.y() * camera.line_delay_s);
  if (q_0C) *q_0C = drift_ * *q_0C * camera.theta.q_CI.conjugate();
  return PlaneAt(camera.theta, z_px, q_0C);
}

bool FeatureTracker::Align(const cv::Mat& smooth,
                           const Camera& camera,
                           double t_s,
                           PatchWarp warp,
                           Point* point) const {
  if (point->patch->Align(smooth, PlaneOf(camera, warp.z_px, t_s), &warp) <
      options_.min_correlation) {
    return false;
  }
  point->A = warp.A;
  point->z_px = AsPoint(warp.z_px);
  const Eigen::Vector2d stretch = warp.A.jacobiSvd().singularValues();
  if ((stretch[0] > kMaxStretch || stretch[1] < 1 / kMaxStretch) &&
      IsInside(smooth, point->z_px, kPatchBorder_px)) {
    point->patch = std::make_shared<PatchTemplate>(
        smooth, warp.z_px, PlaneOf(camera, warp.z_px, t_s));
    point->A.setIdentity();
  }
  return true;
}

void FeatureTracker::Follow(int camera, const cv::Mat& image, double t_s) {
  Camera& c = cameras_[static_cast<std::size_t>(camera)];
  Pyramid next = PyramidOf(image);
  cv::Mat smooth;
  cv::GaussianBlur(image, smooth, {0, 0}, kSmoothing_px);
  std::vector<cv::Point2f> before;
  if (!c.image.empty()) {
    std::vector<PatchWarp> warps;
    std::vector<cv::Point2f> found;
    for (const Point& point : c.points) {
      PatchWarp warp{point.A, AsVector(point.z_px)};
      TransferWarp(c, point, c, t_s, std::nullopt, &warp);
      warps.push_back(warp);
      before.push_back(point.z_px);
      found.push_back(AsPoint(warp.z_px));
    }
    const double ratio =
        BrightnessRatio(c.image, image, before, found, options_.flow.window_px);
    if (std::abs(ratio - 1) > kBrightnessTolerance) {
      cv::Mat scaled;
      c.image.convertTo(scaled, CV_8U, ratio);
      c.pyramid = PyramidOf(scaled);
    }
    std::vector<char> kept =
        FollowPatches(c.pyramid, next, before, options_.flow, &found);
    counts_.followed += static_cast<int>(before.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      kept[i] = kept[i] && IsInside(image, found[i], kFlowBorder_px);
      c.points[i].z_px = found[i];
      if (!kept[i]) {
        ++counts_.lost;
      } else if (options_.align) {
        warps[i].z_px = AsVector(found[i]);
        kept[i] = Align(smooth, c, t_s, warps[i], &c.points[i]);
        if (!kept[i]) ++counts_.changed;
      }
    }
    Keep(kept, &before);
    Keep(kept, &c.points);
  }
  const double before_s = c.t_s;
  c.t_s = t_s;
  c.image = image.clone();
  c.smooth = smooth;
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
    const auto a = RayOf(*camera, AsVector(before[i]), before_s);
    const auto b =
        RayOf(*camera, AsVector(camera->points[i].z_px), camera->t_s);
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
  if (camera == &cameras_.front()) CorrectDrift(before_s, fit.q_BA);
  for (std::size_t n = 0; n < index.size(); ++n) {
    kept[index[n]] = fit.inliers[n];
  }
  counts_.rejected +=
      static_cast<int>(std::count(kept.begin(), kept.end(), char{0}));
  Keep(kept, &camera->points);
}

void FeatureTracker::CorrectDrift(double before_s,
                                  const Eigen::Quaterniond& q_now_before) {
  const auto before = gyro_.OrientationAt(before_s);
  const auto now = gyro_.OrientationAt(cameras_.front().t_s);
  if (!before || !now) return;
  drift_ = drift_ * *before * q_now_before.conjugate() * now->conjugate();
  drift_.normalize();
}

void FeatureTracker::Replenish(int camera, const std::vector<char>& present) {
  Camera& c = cameras_[static_cast<std::size_t>(camera)];
  const std::size_t first = c.points.size();
  std::vector<cv::Point2f> corners;
  if (static_cast<int>(first) < options_.max_tracks) {
    std::vector<cv::Point2f> taken;
    for (const Point& point : c.points) taken.push_back(point.z_px);
    corners = FindCorners(c.image, taken, options_.corners);
  }
  for (const cv::Point2f& corner : corners) {
    if (static_cast<int>(c.points.size()) >= options_.max_tracks) break;
    Point point{next_landmark_++, corner, nullptr};
    if (options_.align) {
      point.patch = std::make_shared<PatchTemplate>(
          c.smooth, AsVector(corner), PlaneOf(c, AsVector(corner), c.t_s));
    }
    c.points.push_back(std::move(point));
    ++counts_.begun;
  }
  for (std::size_t j = 0; j < cameras_.size(); ++j) {
    if (present[j] && static_cast<int>(j) != camera) {
      MatchNew(c, first, &cameras_[j]);
    }
  }
}

std::vector<FeatureTracker::Point> FeatureTracker::Unmatched(
    const Camera& from, std::size_t first, const Camera& to) const {
  std::unordered_set<std::uint64_t> matched;
  for (const Point& point : to.points) matched.insert(point.landmark);
  std::vector<Point> open;
  for (std::size_t i = 0; i < from.points.size(); ++i) {
    const Point& point = from.points[i];
    const bool due =
        (point.landmark + static_cast<std::uint64_t>(images_)) % kMatchAgain ==
        0;
    if ((i >= first || due) && !matched.contains(point.landmark)) {
      open.push_back(point);
    }
  }
  return open;
}

void FeatureTracker::MatchNew(const Camera& from,
                              std::size_t first,
                              Camera* to) {
  std::vector<Point> open = Unmatched(from, first, *to);
  std::optional<Pyramid> as_bright;
  for (const double distance_m : options_.stereo_distances_m) {
    std::vector<cv::Point2f> points;
    std::vector<cv::Point2f> found;
    std::vector<PatchWarp> warps;
    std::vector<std::size_t> index;
    for (std::size_t i = 0; i < open.size(); ++i) {
      PatchWarp warp;
      if (!TransferWarp(from, open[i], *to, to->t_s, distance_m, &warp) ||
          !IsInside(to->image, AsPoint(warp.z_px), kPatchBorder_px)) {
        continue;
      }
      points.push_back(open[i].z_px);
      found.push_back(AsPoint(warp.z_px));
      warps.push_back(warp);
      index.push_back(i);
    }
    if (points.empty()) continue;
    if (!as_bright) {
      const double ratio = BrightnessRatio(
          from.image, to->image, points, found, options_.flow.window_px);
      as_bright = from.pyramid;
      if (std::abs(ratio - 1) > kBrightnessTolerance) {
        cv::Mat scaled;
        from.image.convertTo(scaled, CV_8U, ratio);
        as_bright = PyramidOf(scaled);
      }
    }
    const std::vector<char> ok =
        FollowPatches(*as_bright, to->pyramid, points, options_.flow, &found);
    std::vector<char> still_open(open.size(), 1);
    for (std::size_t n = 0; n < ok.size(); ++n) {
      if (!ok[n] || !IsInside(to->image, found[n], kPatchBorder_px)) continue;
      Point match = open[index[n]];
      match.z_px = found[n];
      if (options_.align) {
        warps[n].z_px = AsVector(found[n]);
        if (!Align(to->smooth, *to, to->t_s, warps[n], &match)) continue;
      }
      still_open[index[n]] = 0;
      if (HasRoom(*to, match.z_px)) {
        to->points.push_back(match);
        ++counts_.stereo_found;
      }
    }
    Keep(still_open, &open);
  }
}

bool FeatureTracker::HasRoom(const Camera& camera,
                             const cv::Point2f& z_px) const {
  return static_cast<int>(camera.points.size()) < 2 * options_.max_tracks &&
         std::all_of(camera.points.begin(),
                     camera.points.end(),
                     [&](const Point& other) {
                       return cv::norm(other.z_px - z_px) >=
                              options_.corners.min_distance_px / 2;
                     });
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
    const auto ray_a =
        RayOf(*a, AsVector(a->points[match->second].z_px), a->t_s);
    const auto ray_b = RayOf(*b, AsVector(b->points[i].z_px), b->t_s);
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
