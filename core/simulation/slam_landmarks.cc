#include "core/simulation/slam_landmarks.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/model/median.h"
#include "core/simulation/random.h"
#include "core/simulation/streams.h"

namespace selfcal {
namespace {

constexpr int kMaxIterations = 10;
constexpr double kConverged_m = 1e-7;
// Huber's threshold. A wrong calibration changes pixels by a few pixels, which
// is not an outlier.
constexpr double kHuber_px = 4;
// A landmark with a larger median residual is rejected.
constexpr double kMaxMedian_px = 20;
// Standard deviation of the map's prior on the logarithm of a distance.
constexpr double kRangeSigma = 0.1;

// A camera at a keyframe, p_C = R_CG p_G + p_CG, and its observation.
struct View {
  const CameraCalibration* camera;
  Eigen::Matrix3d R_CG;
  Eigen::Vector3d p_CG;
  Eigen::Vector2d z_px;
};

View MakeView(const Calibration& theta,
              const KeyframeState& state,
              const FeatureObservation& observation) {
  const CameraCalibration& camera = theta.cameras[observation.camera];
  View view;
  view.camera = &camera;
  view.R_CG = (camera.q_CI * state.q_GI.conjugate()).toRotationMatrix();
  view.p_CG = camera.p_CI - view.R_CG * state.p_GI;
  view.z_px = observation.measured_px;
  return view;
}

struct NormalEquations {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
};

// Adds r^2 / sigma^2 of the reprojection, with Huber's weight.
void AddView(const View& view,
             const Eigen::Vector3d& p_G,
             double sigma_px,
             NormalEquations* sum) {
  Eigen::Vector2d z_px;
  ProjectionJacobians jacobians;
  const Eigen::Vector3d p_C = view.R_CG * p_G + view.p_CG;
  if (!Project(*view.camera, p_C, &z_px, &jacobians)) return;
  const Eigen::Vector2d r = z_px - view.z_px;
  const double weight = std::min(1.0, kHuber_px / std::max(r.norm(), 1e-12)) /
                        (sigma_px * sigma_px);
  const Eigen::Matrix<double, 2, 3> J = jacobians.point * view.R_CG;
  sum->H += weight * J.transpose() * J;
  sum->b -= weight * J.transpose() * r;
}

// Adds the prior on the distance to a_G.
void AddRange(const Eigen::Vector3d& a_G,
              double range_m,
              const Eigen::Vector3d& p_G,
              NormalEquations* sum) {
  const Eigen::Vector3d ray = p_G - a_G;
  const double r = std::log(ray.norm() / range_m) / kRangeSigma;
  const Eigen::Vector3d J = ray / (ray.squaredNorm() * kRangeSigma);
  sum->H += J * J.transpose();
  sum->b -= J * r;
}

bool IsConsistent(const std::vector<View>& views, const Eigen::Vector3d& p_G) {
  std::vector<double> norms;
  for (const View& view : views) {
    Eigen::Vector2d z_px;
    if (Project(*view.camera, view.R_CG * p_G + view.p_CG, &z_px, nullptr)) {
      norms.push_back((z_px - view.z_px).norm());
    }
  }
  if (2 * norms.size() <= views.size()) return false;
  return UpperMedian(norms) < kMaxMedian_px;
}

// Gauss-Newton from the point of the map.
std::optional<Eigen::Vector3d> Triangulate(const std::vector<View>& views,
                                           const Eigen::Vector3d& start_G,
                                           double sigma_px) {
  const Eigen::Vector3d a_G =
      -(views.front().R_CG.transpose() * views.front().p_CG);
  const double range_m = (start_G - a_G).norm();
  Eigen::Vector3d p_G = start_G;
  for (int i = 0; i < kMaxIterations; ++i) {
    NormalEquations sum;
    for (const View& view : views) AddView(view, p_G, sigma_px, &sum);
    AddRange(a_G, range_m, p_G, &sum);
    Eigen::Vector3d step = sum.H.ldlt().solve(sum.b);
    if (!step.allFinite()) return std::nullopt;
    // A step is limited to half of the distance: the point stays in front.
    const double longest_m = 0.5 * (p_G - a_G).norm();
    if (step.norm() > longest_m) step *= longest_m / step.norm();
    p_G += step;
    if (step.norm() < kConverged_m) break;
  }
  if (!IsConsistent(views, p_G)) return std::nullopt;
  return p_G;
}

}  // namespace

std::vector<std::optional<Eigen::Vector3d>> TriangulateLandmarks(
    const Calibration& theta_slam,
    const Exposures& slam_exposures,
    const FeatureTracks& tracks,
    double pixel_sigma_px,
    const SimulationOptions& options) {
  const std::size_t count = tracks.landmarks_G.size();
  std::vector<std::vector<View>> views(count);
  for (const FeatureObservation& observation : tracks.observations) {
    const KeyframeState state = slam_exposures.At(
        observation.camera, observation.keyframe, observation.measured_px.y());
    views[observation.landmark].push_back(
        MakeView(theta_slam, state, observation));
  }
  Random random(options.seed, kSlamLandmarkStream);
  std::vector<std::optional<Eigen::Vector3d>> landmarks_G(count);
  for (std::size_t m = 0; m < count; ++m) {
    const double factor = 1 + options.slam_landmark_relative * random.Normal();
    if (static_cast<int>(views[m].size()) < kMinSegmentObservations) continue;
    const View& first = views[m].front();
    const Eigen::Vector3d a_G = -(first.R_CG.transpose() * first.p_CG);
    landmarks_G[m] = Triangulate(
        views[m], a_G + factor * (tracks.landmarks_G[m] - a_G), pixel_sigma_px);
  }
  return landmarks_G;
}

}  // namespace selfcal
