#include "core/calibration/triangulate.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/factor/reprojection.h"
#include "core/model/camera.h"

namespace selfcal {
namespace {

constexpr int kMaxSteps = 12;
// Rays from which pairs are formed, evenly over the track.
constexpr int kMaxRays = 5;
// Of the loss that finds the place among outliers, in robust sigmas.
constexpr double kSearchLossScale = 2.0;
// A point further away than this is given by its direction alone.
constexpr double kMinInverseDepth = 1e-4;
constexpr double kMedianOfRayleigh = 1.1774100225154747;

struct Ray {
  Eigen::Vector3d center_G;
  Eigen::Vector3d bearing_G;
};

Eigen::Vector3d CameraCenter(const KeyframeState& x,
                             const CameraCalibration& camera) {
  return x.p_GI - x.q_GI * (camera.q_CI.conjugate() * camera.p_CI);
}

std::vector<Ray> SpreadRays(const LandmarkScene& scene, const Track& track) {
  const int n = static_cast<int>(track.observations.size());
  const int count = std::min(n, kMaxRays);
  std::vector<Ray> rays;
  for (int i = 0; i < count; ++i) {
    const int index = count == 1 ? 0 : i * (n - 1) / (count - 1);
    const TrackObservation& seen = track.observations[index];
    const KeyframeState& x = scene.keyframes[seen.keyframe];
    const CameraCalibration& camera = scene.theta.cameras[seen.camera];
    Eigen::Vector3d bearing_C;
    if (Unproject(camera, seen.z_px, &bearing_C)) {
      rays.push_back({CameraCenter(x, camera),
                      x.q_GI * (camera.q_CI.conjugate() * bearing_C)});
    }
  }
  return rays;
}

double MedianNorm(std::vector<double> norms) {
  const auto middle = norms.begin() + norms.size() / 2;
  std::nth_element(norms.begin(), middle, norms.end());
  return *middle;
}

// The point on ray a that is nearest in angle to ray b, homogeneous.
std::optional<Eigen::Vector4d> IntersectRays(const Ray& a, const Ray& b) {
  const Eigen::Vector3d u = b.bearing_G.cross(a.center_G - b.center_G);
  const Eigen::Vector3d v = b.bearing_G.cross(a.bearing_G);
  const double baseline2 = u.squaredNorm();
  if (baseline2 == 0) {
    return std::nullopt;
  }
  const double rho =
      std::clamp(-u.dot(v) / baseline2, kMinInverseDepth, kInverseDepthSigma);
  Eigen::Vector4d point;
  point << rho * a.center_G + a.bearing_G, rho;
  return point;
}

LandmarkPlace PlaceAt(const LandmarkScene& scene,
                      const Track& track,
                      const Eigen::Vector4d& point_G) {
  const TrackObservation& first = track.observations.front();
  LandmarkPlace place;
  place.anchor.a_G = CameraCenter(scene.keyframes[first.keyframe],
                                  scene.theta.cameras[first.camera]);
  const Eigen::Vector3d ray = point_G.head<3>() - point_G(3) * place.anchor.a_G;
  place.anchor.R_GA =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), ray)
          .toRotationMatrix();
  place.inverse_depth = {0, 0, point_G(3) / ray.norm()};
  return place;
}

struct Linearised {
  double cost = 0;
  int projected = 0;
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
};

Linearised Linearise(const LandmarkScene& scene,
                     const Track& track,
                     std::span<const int> used,
                     const RobustLoss& loss,
                     const LandmarkPlace& place) {
  Linearised sum;
  const Eigen::Vector4d point_G = place.Homogeneous();
  Eigen::Matrix<double, 4, 3> by_place;
  by_place.topLeftCorner<3, 2>() = place.anchor.R_GA.leftCols<2>();
  by_place.topRightCorner<3, 1>() = place.anchor.a_G;
  by_place.bottomRows<1>() = Eigen::RowVector3d::UnitZ();
  const double prior = 1 / (kInverseDepthSigma * kInverseDepthSigma);
  const double rho = place.inverse_depth.z();
  sum.cost = prior * rho * rho;
  sum.H(2, 2) = prior;
  sum.g(2) = prior * rho;
  Eigen::Vector2d r;
  ReprojectionJacobians jacobians;
  for (const int index : used) {
    const TrackObservation& seen = track.observations[index];
    const KeyframeState& x = scene.keyframes[seen.keyframe];
    if (!Reproject(x.q_GI,
                   x.p_GI,
                   scene.theta.cameras[seen.camera],
                   point_G,
                   seen.z_px,
                   &r,
                   &jacobians)) {
      continue;
    }
    ++sum.projected;
    r /= scene.pixel_sigma_px;
    const Eigen::Matrix<double, 2, 3> J =
        jacobians.landmark * by_place / scene.pixel_sigma_px;
    const double weight = loss.Weight(r.squaredNorm());
    sum.cost += loss.Value(r.squaredNorm());
    sum.H += weight * J.transpose() * J;
    sum.g += weight * J.transpose() * r;
  }
  return sum;
}

}  // namespace

std::vector<double> ResidualNorms(const LandmarkScene& scene,
                                  const Track& track,
                                  const Eigen::Vector4d& landmark_G) {
  std::vector<double> norms;
  norms.reserve(track.observations.size());
  Eigen::Vector2d r;
  for (const TrackObservation& seen : track.observations) {
    const KeyframeState& x = scene.keyframes[seen.keyframe];
    const bool projects = Reproject(x.q_GI,
                                    x.p_GI,
                                    scene.theta.cameras[seen.camera],
                                    landmark_G,
                                    seen.z_px,
                                    &r,
                                    nullptr);
    norms.push_back(projects ? r.norm()
                             : std::numeric_limits<double>::infinity());
  }
  return norms;
}

Eigen::Matrix3d RefinePlace(const LandmarkScene& scene,
                            const Track& track,
                            std::span<const int> used,
                            const RobustLoss& loss,
                            LandmarkPlace* place) {
  Linearised here = Linearise(scene, track, used, loss, *place);
  double damping = 1e-6;
  for (int i = 0; i < kMaxSteps; ++i) {
    Eigen::Matrix3d H = here.H;
    H.diagonal() *= 1 + damping;
    H.diagonal().array() += std::numeric_limits<double>::min();
    const Eigen::Vector3d step = -H.ldlt().solve(here.g);
    // A step far below a sigma of the place changes nothing that is measured.
    if (!step.allFinite() || -step.dot(here.g) < 1e-16) {
      break;
    }
    LandmarkPlace next = *place;
    next.inverse_depth += step;
    const Linearised there = Linearise(scene, track, used, loss, next);
    if (there.projected >= here.projected && there.cost < here.cost) {
      *place = next;
      here = there;
      damping *= 0.1;
    } else {
      damping = std::max(damping * 100, 1e-3);
    }
  }
  return here.H;
}

std::optional<LandmarkPlace> TriangulateTrack(const LandmarkScene& scene,
                                              const Track& track) {
  const std::vector<Ray> rays = SpreadRays(scene, track);
  double best_px = std::numeric_limits<double>::infinity();
  Eigen::Vector4d best_G = Eigen::Vector4d::UnitZ();
  for (std::size_t a = 0; a < rays.size(); ++a) {
    for (std::size_t b = 0; b < rays.size(); ++b) {
      const auto point_G =
          a == b ? std::nullopt : IntersectRays(rays[a], rays[b]);
      if (!point_G) {
        continue;
      }
      const double median_px =
          MedianNorm(ResidualNorms(scene, track, *point_G));
      if (median_px < best_px) {
        best_px = median_px;
        best_G = *point_G;
      }
    }
  }
  if (!std::isfinite(best_px)) {
    return std::nullopt;
  }
  LandmarkPlace place = PlaceAt(scene, track, best_G);
  std::vector<int> all(track.observations.size());
  std::iota(all.begin(), all.end(), 0);
  const double robust_sigmas =
      std::max(1.0, best_px / kMedianOfRayleigh / scene.pixel_sigma_px);
  RefinePlace(
      scene,
      track,
      all,
      {.kind = LossKind::kCauchy, .scale = kSearchLossScale * robust_sigmas},
      &place);
  return place;
}

}  // namespace selfcal
