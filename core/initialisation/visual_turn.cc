#include "core/initialisation/visual_turn.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "core/model/median.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

// Scales of the residuals of distant points: as after a fast rotation, and as
// after a small translation.
constexpr double kFirstScale_rad = 0.2;
constexpr double kLeastScale_rad = 0.003;
constexpr double kNextTurnScale = 0.6;
// Error of the rotation of distant points: it follows the mean parallax.
constexpr double kRotationSigma_rad = 0.1;
constexpr double kFlowShare = 0.1;

}  // namespace

Eigen::Quaterniond RotationOfMoments(const Eigen::Matrix3d& moments) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(
      moments, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  signs.z() = svd.matrixU().determinant() * svd.matrixV().determinant();
  const Eigen::Matrix3d R =
      svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  return Eigen::Quaterniond(R).normalized();
}

Eigen::Quaterniond RotationOfDistantPoints(const std::vector<RayPair>& pairs) {
  Eigen::Quaterniond q_BA = Eigen::Quaterniond::Identity();
  std::vector<double> errors(pairs.size());
  for (double scale = kFirstScale_rad; scale > kLeastScale_rad;
       scale *= kNextTurnScale) {
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      errors[i] = (pairs[i].b - q_BA * pairs[i].a).norm();
    }
    const double limit = std::max(scale, UpperMedian(errors));
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const double ratio = errors[i] / limit;
      const double weight = 1 / std::pow(1 + ratio * ratio, 2);
      moments += weight * pairs[i].b * pairs[i].a.transpose();
    }
    q_BA = RotationOfMoments(moments);
  }
  return q_BA;
}

std::vector<VisualTurn> VisualTurns(const RayImages& rays,
                                    const std::vector<ImagePair>& pairs) {
  EpipolarOptions options;
  options.px_per_rad = rays.px_per_rad();
  options.rotation_sigma_rad = kRotationSigma_rad;
  options.flow_share = kFlowShare;
  const CameraCalibration& camera = rays.camera();
  const double middle_s = MiddleRowDelay(camera, 0) - camera.time_offset_s;
  std::vector<VisualTurn> turns;
  std::vector<RayPair> matches;
  for (const ImagePair& pair : pairs) {
    const RayImage& from = rays.images()[pair.from];
    const RayImage& to = rays.images()[pair.to];
    matches.clear();
    for (const auto& [i, j] : pair.matches) {
      matches.push_back({from.points[i].ray_C, to.points[j].ray_C});
    }
    const EpipolarFit fit =
        CheckEpipolar(matches, RotationOfDistantPoints(matches), options);
    turns.push_back(
        {from.t_s + middle_s, to.t_s + middle_s, Log(fit.q_BA.conjugate())});
  }
  return turns;
}

}  // namespace selfcal
