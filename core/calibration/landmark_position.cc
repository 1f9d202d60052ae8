#include "core/calibration/landmark_position.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/model/camera.h"

namespace selfcal {
namespace {

// No point is further away than 1 / this [m].
constexpr double kLeastInverseDepth = 1e-4;
// A step is small if it changes the inverse depth by less than this fraction.
constexpr double kMaxRelativeStep = 0.5;

struct Linearised {
  double cost = 0;
  int projected = 0;
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
};

Linearised Linearise(const LandmarkScene& scene,
                     const Track& track,
                     std::span<const UsedObservation> used,
                     const RobustLoss& loss,
                     const LandmarkPosition& position) {
  Linearised sum;
  const Eigen::Vector4d point_G = position.Homogeneous();
  const double prior = 1 / (kInverseDepthSigma * kInverseDepthSigma);
  const double rho = position.inverse_depth.z();
  sum.cost = prior * rho * rho;
  sum.H(2, 2) = prior;
  sum.g(2) = prior * rho;
  const double scale = 1 / scene.pixel_sigma_px();
  Eigen::Vector2d r;
  Eigen::Matrix<double, 2, 3> by_p_C;
  Eigen::Matrix3d p_C_by_position;
  for (const UsedObservation& one : used) {
    const TrackObservation& seen = track.observations[one.index];
    if (!scene.Residual(seen, point_G, &r, &by_p_C)) {
      sum.cost +=
          one.weight * loss.Value(kNotProjectedSigmas * kNotProjectedSigmas);
      continue;
    }
    ++sum.projected;
    r *= scale;
    const CameraPose camera = scene.PoseOf(seen);
    p_C_by_position.leftCols<2>() =
        camera.R_CG * position.anchor.R_GA.leftCols<2>();
    p_C_by_position.col(2) = camera.R_CG * position.anchor.a_G + camera.p_CG;
    const Eigen::Matrix<double, 2, 3> J = scale * by_p_C * p_C_by_position;
    const double s = r.squaredNorm();
    const double weight = one.weight * loss.Weight(s);
    sum.cost += one.weight * loss.Value(s);
    sum.H += weight * J.transpose() * J;
    sum.g += weight * J.transpose() * r;
  }
  return sum;
}

// Smallest allowed inverse depth of a landmark whose information is H.
double LeastInverseDepth(const Eigen::Matrix3d& H) {
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(H);
  const double variance = ldlt.solve(Eigen::Vector3d::UnitZ().eval())(2);
  return variance > 0 ? -kMaxBeyondInfinity * std::sqrt(variance)
                      : -std::numeric_limits<double>::infinity();
}

// Step of the other two parameters for a given step of inverse depth.
Eigen::Vector3d StepWithDepth(const Eigen::Matrix3d& H,
                              const Eigen::Vector3d& g,
                              double depth_step) {
  const Eigen::Vector2d rhs =
      g.head<2>() + H.topRightCorner<2, 1>() * depth_step;
  Eigen::Vector3d step;
  step << -H.topLeftCorner<2, 2>().ldlt().solve(rhs), depth_step;
  return step;
}

}  // namespace

LandmarkScene::LandmarkScene(ChainThetas thetas,
                             std::span<const KeyframeState> keyframes,
                             const KeyframeMotions& motions,
                             double pixel_sigma_px)
    : thetas_(std::move(thetas)),
      keyframes_(keyframes),
      motions_(motions),
      pixel_sigma_px_(pixel_sigma_px) {
  const int cameras = static_cast<int>(thetas_[0].cameras.size());
  poses_.reserve(keyframes.size() * cameras);
  for (int k = 0; k < static_cast<int>(keyframes.size()); ++k) {
    for (int j = 0; j < cameras; ++j) {
      poses_.push_back(ExposedAt(k, j, Eigen::Vector2d::Zero()));
    }
  }
}

CameraPose LandmarkScene::ExposedAt(int keyframe,
                                    int camera,
                                    const Eigen::Vector2d& z_px) const {
  const CameraCalibration& c = thetas_.OfKeyframe(keyframe).cameras[camera];
  Eigen::Quaterniond q_GI = keyframes_[keyframe].q_GI;
  Eigen::Vector3d p_GI = keyframes_[keyframe].p_GI;
  if (const KeyframeMotion* motion = motions_.At(keyframe, camera)) {
    const ExposurePose exposure = MovePose(q_GI, p_GI, *motion, c, z_px);
    q_GI = exposure.q_GI;
    p_GI = exposure.p_GI;
  }
  const Eigen::Matrix3d R_CG = (c.q_CI * q_GI.conjugate()).toRotationMatrix();
  return {R_CG, c.p_CI - R_CG * p_GI};
}

bool LandmarkScene::Residual(const TrackObservation& seen,
                             const Eigen::Vector4d& point_G,
                             Eigen::Vector2d* residual_px,
                             Eigen::Matrix<double, 2, 3>* by_p_C) const {
  const CameraPose pose = PoseOf(seen);
  const Eigen::Vector3d p_C =
      pose.R_CG * point_G.head<3>() + point_G(3) * pose.p_CG;
  ProjectionJacobians jacobians;
  Eigen::Vector2d z_px;
  if (p_C.norm() < kMinDistance_m * std::abs(point_G(3))) {
    return false;
  }
  if (!Project(camera(seen), p_C, &z_px, by_p_C ? &jacobians : nullptr)) {
    return false;
  }
  *residual_px = z_px - seen.z_px;
  if (by_p_C) {
    *by_p_C = jacobians.point;
  }
  return true;
}

Eigen::Vector3d LandmarkPosition::Point() const {
  const Eigen::Vector4d point = Homogeneous();
  return point.head<3>() / std::max(point(3), kLeastInverseDepth);
}

void LandmarkPosition::Move(const Eigen::Vector3d& step) {
  const double rho = inverse_depth.z();
  if (std::abs(step.z()) > kMaxRelativeStep * rho) {
    inverse_depth += step;
    return;
  }
  // x / rho is the point in the anchor's frame, with x = (alpha, beta, 1).
  const Eigen::Vector3d x = inverse_depth.head<2>().homogeneous();
  Eigen::Vector3d point = x - x * (step.z() / rho);
  point.head<2>() += step.head<2>();
  inverse_depth << point.head<2>() / point.z(), rho / point.z();
}

LandmarkPrior InverseDepthPrior(const LandmarkPosition& position,
                                double weight) {
  const double rho = position.inverse_depth.z();
  const Eigen::Vector3d rho_by_p = -rho * rho * position.anchor.R_GA.col(2);
  const double information =
      weight * (1 / (kInverseDepthSigma * kInverseDepthSigma));
  return {information * rho_by_p * rho_by_p.transpose(),
          information * rho * rho_by_p};
}

Eigen::Vector3d InverseDepthStep(const LandmarkPosition& position,
                                 const Eigen::Vector3d& step_G) {
  const double rho = position.inverse_depth.z();
  const Eigen::Vector3d q = rho * (position.anchor.R_GA.transpose() * step_G);
  return {q.x() - position.inverse_depth.x() * q.z(),
          q.y() - position.inverse_depth.y() * q.z(),
          -rho * q.z()};
}

LandmarkPosition PositionAt(const LandmarkScene& scene,
                            const Track& track,
                            const Eigen::Vector4d& point_G) {
  const TrackObservation& first = track.observations.front();
  LandmarkPosition position;
  const CameraPose camera = scene.PoseOf(first);
  position.anchor.a_G = -(camera.R_CG.transpose() * camera.p_CG);
  const Eigen::Vector3d ray =
      point_G.head<3>() - point_G(3) * position.anchor.a_G;
  position.anchor.R_GA =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), ray)
          .toRotationMatrix();
  position.inverse_depth = {0, 0, point_G(3) / ray.norm()};
  return position;
}

RefinedPosition RefinePosition(const LandmarkScene& scene,
                               const Track& track,
                               std::span<const UsedObservation> used,
                               const RobustLoss& loss,
                               const RefineLimits& limits,
                               LandmarkPosition* position) {
  Linearised here = Linearise(scene, track, used, loss, *position);
  double least = LeastInverseDepth(here.H);
  if (limits.steps > 0 && position->inverse_depth.z() < 2 * least) {
    position->inverse_depth.z() = 0;
    here = Linearise(scene, track, used, loss, *position);
    least = LeastInverseDepth(here.H);
  }
  bool behind = false;
  double damping = 1e-6;
  // Beyond the loss's scale the cost has less curvature than Gauss-Newton
  // assumes, so that single steps are too short: they are stretched as long as
  // they gain more than predicted.
  double stretch = 1;
  for (int i = 0; i < limits.steps; ++i) {
    Eigen::Matrix3d H = here.H;
    H.diagonal() *= 1 + damping;
    H.diagonal().array() += std::numeric_limits<double>::min();
    Eigen::Vector3d step = -H.ldlt().solve(here.g);
    const double room = least - position->inverse_depth.z();
    behind = stretch * step.z() < room;
    if (behind) {
      stretch = 1;
      step = StepWithDepth(H, here.g, std::min(room, 0.0));
    }
    if (!step.allFinite() || -step.dot(here.g) < limits.decrease) {
      break;
    }
    LandmarkPosition next = *position;
    next.inverse_depth += stretch * step;
    const Linearised there = Linearise(scene, track, used, loss, next);
    if (there.projected >= here.projected && there.cost < here.cost) {
      const double predicted = -stretch * (2 - stretch) * step.dot(here.g);
      stretch = here.cost - there.cost > predicted ? 2 * stretch : 1;
      *position = next;
      here = there;
      least = LeastInverseDepth(here.H);
      damping *= 0.1;
    } else {
      stretch = 1;
      damping = std::max(damping * 100, 1e-3);
    }
  }
  return {here.H, here.cost, behind};
}

std::vector<UsedObservation> AllOf(const Track& track) {
  std::vector<UsedObservation> all(track.observations.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i].index = static_cast<int>(i);
  }
  return all;
}

std::vector<double> ResidualNorms(const LandmarkScene& scene,
                                  const Track& track,
                                  const Eigen::Vector4d& point_G) {
  std::vector<double> norms;
  norms.reserve(track.observations.size());
  Eigen::Vector2d r;
  for (const TrackObservation& seen : track.observations) {
    norms.push_back(scene.Residual(seen, point_G, &r, nullptr)
                        ? r.norm()
                        : std::numeric_limits<double>::infinity());
  }
  return norms;
}

}  // namespace selfcal
