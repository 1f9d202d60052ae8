#include "core/motion/alignment.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "core/model/camera.h"
#include "core/model/median.h"
#include "core/motion/exposure_path.h"

namespace selfcal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using PathInformation = Eigen::Matrix<double, kPathUnknowns, kPathUnknowns>;

constexpr int kIterations = 12;
// Weights of the first iterations are not robust, since all residuals are
// large while distances are not known.
constexpr int kPlainIterations = 3;
constexpr double kFirstDistance_m = 2;
constexpr double kMinDistance_m = 0.2;
constexpr double kMaxDistance_m = 50;
// Standard deviations of what is known of a device that a person or a vehicle
// moves: its speed at either end, and the biases.
constexpr double kSpeed_mps = 3;
constexpr double kAccelBias_mps2 = 0.2;
// The same for a segment that continues another.
constexpr double kVelocityAfter_mps = 0.1;
constexpr double kGravityAfter_mps2 = 0.1;
constexpr double kAccelBiasAfter_mps2 = 0.03;
constexpr double kGravityLength_mps2 = 0.01;
// Residuals beyond this many robust standard deviations have little weight.
constexpr double kCauchySigmas = 2;
// Information about a landmark along its rays, relative to that across.
constexpr double kNoParallax = 1e-9;
// Part of the observations that have to agree.
constexpr double kMinAgreeing = 0.5;
constexpr double kAgreeingSigmas = 5;

struct Ray {
  const PathNode* node;
  Matrix3d Q;  // I - u u^T, u_B the direction
  Vector3d u_B;
  Vector3d p_BC_0;  // the camera relative to the body, in B
  double px_per_rad;
  double distance_m = kFirstDistance_m;
  double residual_px = 0;
};

struct RaysOfLandmark {
  std::vector<Ray> rays;
  Vector3d p_B = Vector3d::Zero();
};

class Alignment {
 public:
  Alignment(const Rig& rig,
            const Calibration& theta,
            const MotionStart& start,
            const MotionSegment& segment)
      : rig_(rig),
        start_(start),
        path_(rig, theta, segment, start.b_a, start.b_g),
        keyframes_(static_cast<int>(segment.keyframes.size())),
        landmarks_(segment.landmarks.size()) {
    for (const Observation& seen : segment.observations) {
      const CameraCalibration& camera = theta.cameras[seen.camera];
      Vector3d ray_C;
      if (!Unproject(camera, seen.z_px, &ray_C)) continue;
      const PathNode& node = path_.Exposure(seen.keyframe, seen.camera);
      const Eigen::Quaterniond q_BC = node.q_BI * camera.q_CI.conjugate();
      const Vector3d u_B = (q_BC * ray_C).normalized();
      landmarks_[seen.landmark].rays.push_back(
          {.node = &node,
           .Q = Matrix3d::Identity() - u_B * u_B.transpose(),
           .u_B = u_B,
           .p_BC_0 = -(q_BC * camera.p_CI),
           .px_per_rad = PixelsPerRadian(camera).mean()});
    }
  }

  bool Solve() {
    for (int i = 0; i < kIterations; ++i) {
      if (!Iterate(i)) return false;
      Measure(i);
    }
    return Agrees();
  }

  void Store(MotionSegment* segment) const {
    const PathNode& first = path_.Keyframe(0);
    const Vector3d g_B = x_.segment<3>(kPathGravity);
    Eigen::Quaterniond q_GB =
        Eigen::Quaterniond::FromTwoVectors(g_B, -Vector3d::UnitZ());
    Vector3d p_GB = -(q_GB * first.Position(x_));
    if (start_.first) {
      q_GB = (start_.first->q_GI * first.q_BI.conjugate()).normalized();
      p_GB = start_.first->p_GI - q_GB * first.Position(x_);
    }
    for (int k = 0; k < keyframes_; ++k) {
      const PathNode& node = path_.Keyframe(k);
      KeyframeState& x = segment->keyframes[k];
      x.q_GI = (q_GB * node.q_BI).normalized();
      x.p_GI = q_GB * node.Position(x_) + p_GB;
      x.v_GI = q_GB * node.Velocity(x_);
      x.b_a = start_.b_a + x_.segment<3>(kPathAccelBias);
      x.b_g = start_.b_g;
    }
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
      segment->landmarks[i].p_G = q_GB * landmarks_[i].p_B + p_GB;
    }
  }

 private:
  double Weight(const Ray& ray, bool robust) const {
    const double px_m = ray.px_per_rad / ray.distance_m;
    const double plain = px_m * px_m / (sigma_px_ * sigma_px_);
    if (!robust) return plain;
    const double ratio = ray.residual_px / (kCauchySigmas * sigma_px_);
    return plain / (1 + ratio * ratio);
  }

  // Adds w |J x - r|^2 of three rows.
  static void AddRows(const PathMatrix& J,
                      const Vector3d& r,
                      double w,
                      PathInformation* H,
                      PathUnknowns* b) {
    *H += w * J.transpose() * J;
    *b += w * J.transpose() * r;
  }

  bool Iterate(int iteration) {
    PathInformation H = PathInformation::Zero();
    PathUnknowns b = PathUnknowns::Zero();
    AddPriors(iteration, &H, &b);
    const bool robust = iteration >= kPlainIterations;
    for (const RaysOfLandmark& landmark : landmarks_) {
      AddLandmark(landmark, robust, &H, &b);
    }
    const Eigen::LDLT<PathInformation> ldlt(H);
    x_ = ldlt.solve(b);
    return ldlt.isPositive() && x_.allFinite();
  }

  void AddPriors(int iteration, PathInformation* H, PathUnknowns* b) const {
    const auto square = [](double value) { return value * value; };
    PathMatrix of_bias = PathMatrix::Zero();
    of_bias.middleCols<3>(kPathAccelBias).setIdentity();
    PathMatrix of_gravity = PathMatrix::Zero();
    of_gravity.middleCols<3>(kPathGravity).setIdentity();
    const PathNode& first = path_.Keyframe(0);
    if (start_.first) {
      const Eigen::Quaterniond q_BG =
          first.q_BI * start_.first->q_GI.conjugate();
      AddRows(first.V,
              q_BG * start_.first->v_GI - first.v_0,
              1 / square(kVelocityAfter_mps),
              H,
              b);
      AddRows(of_gravity,
              q_BG * Vector3d(0, 0, -rig_.gravity_mps2),
              1 / square(kGravityAfter_mps2),
              H,
              b);
    } else {
      const PathNode& last = path_.Keyframe(keyframes_ - 1);
      AddRows(first.V, -first.v_0, 1 / square(kSpeed_mps), H, b);
      AddRows(last.V, -last.v_0, 1 / square(kSpeed_mps), H, b);
    }
    AddRows(of_bias,
            Vector3d::Zero(),
            1 / square(start_.first ? kAccelBiasAfter_mps2 : kAccelBias_mps2),
            H,
            b);
    if (iteration > 0) {
      const Vector3d down_B = x_.segment<3>(kPathGravity).normalized();
      PathUnknowns row = PathUnknowns::Zero();
      row.segment<3>(kPathGravity) = down_B;
      const double w = 1 / square(kGravityLength_mps2);
      *H += w * row * row.transpose();
      *b += w * rig_.gravity_mps2 * row;
    }
  }

  // Sum over the rays of w |Q (p_B - P x - o)|^2, minimised over p_B.
  void AddLandmark(const RaysOfLandmark& landmark,
                   bool robust,
                   PathInformation* H,
                   PathUnknowns* b) const {
    if (landmark.rays.size() < 2) return;
    Matrix3d M = Matrix3d::Zero();
    PathMatrix MP = PathMatrix::Zero();
    Vector3d Mo = Vector3d::Zero();
    for (const Ray& ray : landmark.rays) {
      const Matrix3d wQ = Weight(ray, robust) * ray.Q;
      const Vector3d o = ray.node->p_0 + ray.p_BC_0;
      const PathMatrix wQP = wQ * ray.node->P;
      M += wQ;
      MP += wQP;
      Mo += wQ * o;
      *H += ray.node->P.transpose() * wQP;
      *b -= wQP.transpose() * o;
    }
    M.diagonal().array() += kNoParallax * M.trace();
    const Eigen::LDLT<Matrix3d> ldlt(M);
    *H -= MP.transpose() * ldlt.solve(MP);
    *b += MP.transpose() * ldlt.solve(Mo);
  }

  // Positions of landmarks, and with them distances and residuals.
  void Measure(int iteration) {
    const bool robust = iteration >= kPlainIterations;
    std::vector<double> residuals_px;
    for (RaysOfLandmark& landmark : landmarks_) {
      if (landmark.rays.empty()) continue;
      Matrix3d M = Matrix3d::Zero();
      Vector3d Mo = Vector3d::Zero();
      for (const Ray& ray : landmark.rays) {
        const Matrix3d wQ = Weight(ray, robust) * ray.Q;
        M += wQ;
        Mo += wQ * Centre(ray);
      }
      M.diagonal().array() += kNoParallax * M.trace();
      landmark.p_B = M.ldlt().solve(Mo);
      PlaceInFront(&landmark);
      for (Ray& ray : landmark.rays) {
        const Vector3d to_B = landmark.p_B - Centre(ray);
        ray.distance_m =
            std::clamp(to_B.norm(), kMinDistance_m, kMaxDistance_m);
        ray.residual_px =
            ray.px_per_rad * (ray.Q * to_B).norm() / ray.distance_m;
        residuals_px.push_back(ray.residual_px);
      }
    }
    if (residuals_px.empty()) return;
    sigma_px_ =
        std::max(rig_.pixel_sigma_px,
                 UpperMedian(std::move(residuals_px)) / kMedianOfRayleigh);
  }

  Vector3d Centre(const Ray& ray) const {
    return ray.node->Position(x_) + ray.p_BC_0;
  }

  // A landmark without parallax, or behind its cameras, is placed far away
  // along its first ray.
  void PlaceInFront(RaysOfLandmark* landmark) const {
    const Ray& ray = landmark->rays.front();
    const double along_m = ray.u_B.dot(landmark->p_B - Centre(ray));
    if (landmark->p_B.allFinite() && along_m > 0 && along_m < kMaxDistance_m) {
      return;
    }
    landmark->p_B = Centre(ray) + kMaxDistance_m * ray.u_B;
  }

  bool Agrees() const {
    std::size_t all = 0, agreeing = 0;
    for (const RaysOfLandmark& landmark : landmarks_) {
      for (const Ray& ray : landmark.rays) {
        ++all;
        if (ray.residual_px < kAgreeingSigmas * sigma_px_) ++agreeing;
      }
    }
    return all > 0 && static_cast<double>(agreeing) >=
                          kMinAgreeing * static_cast<double>(all);
  }

  const Rig& rig_;
  const MotionStart& start_;
  ExposurePath path_;
  int keyframes_;
  std::vector<RaysOfLandmark> landmarks_;
  PathUnknowns x_ = PathUnknowns::Zero();
  double sigma_px_ = 1;
};

}  // namespace

bool AlignMotion(const Rig& rig,
                 const Calibration& theta,
                 const MotionStart& start,
                 MotionSegment* segment) {
  if (segment->observations.empty()) return false;
  Alignment alignment(rig, theta, start, *segment);
  if (!alignment.Solve()) return false;
  alignment.Store(segment);
  return true;
}

}  // namespace selfcal
