#include "core/preflight/landmark_map.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/model/so3.h"

namespace selfcal {
namespace {

struct Ray {
  Eigen::Vector3d from;  // centre of the camera, in G
  Eigen::Vector3d along;
  Eigen::Vector3d p;  // received landmark, centred and scaled
};

using Affine = Eigen::Matrix<double, 3, 4>;  // (A, t)

// Maps to coordinates with mean 0 and mean square 1, in which the linear
// problem is well scaled whatever the unit of the landmarks.
struct Normalisation {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double size = 1;
};

Normalisation Normalise(std::vector<Ray>* rays) {
  Normalisation to;
  for (const Ray& ray : *rays) to.centre += ray.p;
  to.centre /= static_cast<double>(rays->size());
  double squares = 0;
  for (const Ray& ray : *rays) squares += (ray.p - to.centre).squaredNorm();
  to.size = std::sqrt(squares / static_cast<double>(rays->size()));
  for (Ray& ray : *rays) ray.p = (ray.p - to.centre) / to.size;
  return to;
}

std::vector<Ray> RaysOf(const std::vector<View>& views,
                        const CameraCalibration& camera) {
  const Eigen::Quaterniond q_IC = camera.q_CI.conjugate();
  std::vector<Ray> rays;
  for (const View& view : views) {
    Eigen::Vector3d bearing;
    if (!Unproject(camera, view.z_px, &bearing)) continue;
    rays.push_back({view.pose.ToG(-(q_IC * camera.p_CI)),
                    view.pose.q_GI * (q_IC * bearing),
                    view.p});
  }
  return rays;
}

// Weighted linear least squares in the twelve entries of (A, t), column-major.
std::optional<Affine> Solve(const std::vector<Ray>& rays,
                            const std::vector<double>& weights) {
  // Below this fraction of the largest eigenvalue the rays do not determine a
  // direction.
  constexpr double kMinRatio = 1e-9;
  Eigen::Matrix<double, 12, 12> H = Eigen::Matrix<double, 12, 12>::Zero();
  Eigen::Matrix<double, 12, 1> g = Eigen::Matrix<double, 12, 1>::Zero();
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Matrix3d B = Skew(rays[i].along);
    Eigen::Matrix<double, 3, 12> J;
    J << rays[i].p.x() * B, rays[i].p.y() * B, rays[i].p.z() * B, B;
    H += weights[i] * J.transpose() * J;
    g += weights[i] * J.transpose() * (B * rays[i].from);
  }
  const Eigen::LDLT<Eigen::Matrix<double, 12, 12>> ldlt(H);
  const auto d = ldlt.vectorD();
  if (!(d.minCoeff() > kMinRatio * d.maxCoeff())) return std::nullopt;
  const Eigen::Matrix<double, 12, 1> x = ldlt.solve(g);
  return Affine(Eigen::Map<const Affine>(x.data()));
}

// Weights by the angle between each ray and its landmark; width decreases with
// the iterations.
std::vector<double> Weigh(const std::vector<Ray>& rays,
                          const Affine& map,
                          double width_rad) {
  std::vector<double> weights;
  for (const Ray& ray : rays) {
    const Eigen::Vector3d to = map * ray.p.homogeneous() - ray.from;
    const double distance = std::max(to.norm(), 1e-3);
    const double miss = ray.along.cross(to).norm() / distance / width_rad;
    const bool behind = ray.along.dot(to) < 0;
    weights.push_back((behind ? 0.1 : 1) / (1 + miss * miss) /
                      (distance * distance));
  }
  return weights;
}

std::optional<LandmarkMap> AsMap(const Affine& map, const Normalisation& from) {
  constexpr double kUneven = 0.05;
  const Eigen::Matrix3d A = map.leftCols<3>() / from.size;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      A, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& s = svd.singularValues();
  if (!(s[2] > 0) || s[0] - s[2] > kUneven * s[1]) return std::nullopt;
  const Eigen::Matrix3d R = svd.matrixU() * svd.matrixV().transpose();
  if (R.determinant() < 0) return std::nullopt;
  LandmarkMap result;
  result.R = R;
  result.scale = s.mean();
  result.t = map.col(3) - result.scale * (R * from.centre);
  return result;
}

}  // namespace

std::optional<LandmarkMap> FitLandmarkMap(const std::vector<View>& views,
                                          const CameraCalibration& camera) {
  constexpr std::size_t kMinRays = 50;
  constexpr int kIterations = 8;
  std::vector<Ray> rays = RaysOf(views, camera);
  if (rays.size() < kMinRays) return std::nullopt;
  const Normalisation from = Normalise(&rays);
  if (!(from.size > 0)) return std::nullopt;
  std::vector<double> weights(rays.size(), 1);
  std::optional<Affine> map;
  double width_rad = 0.5;
  for (int n = 0; n < kIterations; ++n) {
    map = Solve(rays, weights);
    if (!map) return std::nullopt;
    weights = Weigh(rays, *map, width_rad);
    width_rad = std::max(width_rad / 2, 5e-3);
  }
  return AsMap(*map, from);
}

}  // namespace selfcal
