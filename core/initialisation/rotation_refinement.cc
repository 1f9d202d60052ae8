#include "core/initialisation/rotation_refinement.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "core/initialisation/epipolar_check.h"
#include "core/initialisation/epipolar_row.h"
#include "core/initialisation/gyro_rotation.h"
#include "core/model/median.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

using Vector8 = Eigen::Matrix<double, kStartSize, 1>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix8 = Eigen::Matrix<double, kStartSize, kStartSize>;

constexpr int kMaxSteps = 60;
// A step of less, in sigmas, is the last.
constexpr double kLastStep = 0.02;
// Directions are searched anew, for the rotations of the estimate, before each
// of the first steps; later ones only follow.
constexpr int kSearches = 4;
constexpr double kFirstScale_px = 8;
constexpr double kNextRefinementScale = 0.7;
constexpr double kLeastScale_px = 0.05;
constexpr double kInlierSigmas = 2.5;  // of the final scale
// A step of a direction, as if there was a prior at where it is.
constexpr double kDirectionStep_rad = 0.3;

// Largest step of each component.
const Vector8 kMaxStep = {0.2, 0.2, 0.2, 0.02, 0.1, 0.1, 0.1, 0.2};

class Refiner {
 public:
  Refiner(const RotationStart& begin,
          const StartPrior& prior,
          const ImuCalibration& imu,
          std::span<const ImuSample> samples,
          const std::vector<ImagePair>& pairs,
          RayImages* rays)
      : prior_(prior),
        at_(begin),
        imu_(imu),
        samples_(samples),
        pairs_(pairs),
        rays_(*rays),
        t_(pairs.size(), Eigen::Vector3d::UnitX()),
        views_(pairs.size()) {}

  RotationStart Run() {
    double scale_px = kFirstScale_px;
    for (int n = 0; n < kMaxSteps; ++n) {
      Predict();
      if (n < kSearches) SearchDirections(n);
      const double least_px = LeastScale();
      scale_px = std::max(scale_px * kNextRefinementScale, least_px);
      if (Step(scale_px) < kLastStep && scale_px == least_px && n > kSearches) {
        break;
      }
    }
    Predict();
    at_.residual_px = RobustSigma();
    at_.covariance = Covariance(LeastScale());
    return at_;
  }

 private:
  // A match with rays in the camera at the middle row of either image.
  struct Match {
    Eigen::Vector3d c;  // R_BA a
    Eigen::Vector3d b;
    Eigen::Vector3d c_by_scale;
    Eigen::Vector3d b_by_scale;
  };
  // A pair of images at the current estimate.
  struct View {
    bool covered = false;
    Eigen::Quaterniond q_BA;
    // Derivative of q_BA, perturbed on the left.
    Eigen::Matrix<double, 3, kStartSize> by_start;
    std::vector<Match> matches;
  };
  // Gauss-Newton equations of the start, with the direction eliminated.
  struct Equations {
    Matrix8 H = Matrix8::Zero();
    Vector8 g = Vector8::Zero();
    // Step of the direction: -(d + D step of the start), on the axes across it.
    Eigen::Vector2d d = Eigen::Vector2d::Zero();
    Eigen::Matrix<double, 2, kStartSize> D =
        Eigen::Matrix<double, 2, kStartSize>::Zero();
  };

  double MiddleRow(const RayImage& image) const {
    return image.t_s + at_.time_offset_s +
           rays_.camera().line_delay_s.value_or(0) * rays_.camera().height_px /
               2;
  }

  // Takes a ray from the camera at the exposure of its row to that at the
  // middle row.
  Eigen::Quaterniond FromRow(const GyroRotation& gyro,
                             double middle_s,
                             const Eigen::Vector2d& z_px) const {
    const CameraCalibration& camera = rays_.camera();
    if (!camera.line_delay_s) return Eigen::Quaterniond::Identity();
    const double row_s =
        middle_s + *camera.line_delay_s * (z_px.y() - camera.height_px / 2.0);
    return at_.q_CI * gyro.Between(middle_s, row_s) * at_.q_CI.conjugate();
  }

  void Predict() {
    rays_.SetFocalScale(at_.focal_scale);
    px_per_rad_ = rays_.px_per_rad();
    GyroRotation gyro(imu_, at_.b_g);
    for (const ImuSample& sample : samples_) gyro.Add(sample);
    const double first_s = 1e-9 * static_cast<double>(samples_.front().t_ns);
    const double last_s = 1e-9 * static_cast<double>(samples_.back().t_ns);
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      const RayImage& from = rays_.images()[pairs_[k].from];
      const RayImage& to = rays_.images()[pairs_[k].to];
      const double from_s = MiddleRow(from);
      const double to_s = MiddleRow(to);
      View& view = views_[k];
      view.covered = from_s >= first_s && to_s <= last_s;
      if (!view.covered) continue;
      const Eigen::Matrix3d R_CI = at_.q_CI.toRotationMatrix();
      const Eigen::Quaterniond q_I1I0 = gyro.Between(to_s, from_s);
      view.q_BA = at_.q_CI * q_I1I0 * at_.q_CI.conjugate();
      view.by_start.setZero();
      view.by_start.middleCols<3>(kStartRotation) =
          R_CI - view.q_BA.toRotationMatrix() * R_CI;
      view.by_start.col(kStartTimeOffset) =
          R_CI * (q_I1I0 * gyro.RateAt(from_s) - gyro.RateAt(to_s));
      view.by_start.middleCols<3>(kStartGyroBias) =
          -R_CI * gyro.BetweenByBias(from_s, to_s);
      view.matches.clear();
      for (const auto& [i, j] : pairs_[k].matches) {
        const ImagePoint& a = from.points[i];
        const ImagePoint& b = to.points[j];
        if (a.ray_C.isZero() || b.ray_C.isZero()) continue;
        const Eigen::Quaterniond q_Ba =
            view.q_BA * FromRow(gyro, from_s, a.z_px);
        const Eigen::Quaterniond q_Bb = FromRow(gyro, to_s, b.z_px);
        view.matches.push_back({q_Ba * a.ray_C,
                                q_Bb * b.ray_C,
                                q_Ba * a.by_scale,
                                q_Bb * b.by_scale});
      }
    }
  }

  void SearchDirections(int search) {
    EpipolarOptions options;
    options.px_per_rad = px_per_rad_;
    // The estimate becomes better with each search.
    options.rotation_sigma_rad = 0.03 * std::pow(0.5, search);
    options.seed = static_cast<std::uint64_t>(search) + 1;
    std::vector<RayPair> rays;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      if (!views_[k].covered) continue;
      rays.clear();
      for (const Match& match : views_[k].matches) {
        rays.push_back({match.c, match.b});
      }
      t_[k] = CheckEpipolar(rays, Eigen::Quaterniond::Identity(), options).t_B;
    }
  }

  double RobustSigma() const {
    std::vector<double> distances;
    EpipolarRow row;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      if (!views_[k].covered) continue;
      for (const Match& match : views_[k].matches) {
        if (MakeEpipolarRow(t_[k], match.c, match.b, px_per_rad_, &row)) {
          distances.push_back(std::abs(row.r));
        }
      }
    }
    return kMadToSigma * UpperMedian(std::move(distances));
  }

  double LeastScale() const {
    return std::max(kLeastScale_px, kInlierSigmas * RobustSigma());
  }

  // Uses Geman-McClure weights; or, for a covariance, with the second
  // derivatives of that loss, but for the elimination of the direction, which
  // they may leave undetermined.
  Equations PairEquations(std::size_t k,
                          double scale_px,
                          bool second_derivatives) const {
    const Eigen::Vector3d u = t_[k].unitOrthogonal();
    const Eigen::Vector3d v = t_[k].cross(u);
    // Order: rotation of q_BA 3, focal scale, direction 2.
    Matrix6 H = Matrix6::Zero();
    Matrix6 H_loss = Matrix6::Zero();
    Vector6 g = Vector6::Zero();
    EpipolarRow row;
    for (const Match& match : views_[k].matches) {
      if (!MakeEpipolarRow(t_[k], match.c, match.b, px_per_rad_, &row)) {
        continue;
      }
      const double square = std::pow(row.r / scale_px, 2);
      const double weight = 1 / std::pow(1 + square, 2);
      Vector6 J;
      J.head<3>() = row.by_rotation;
      // The scale in px/rad grows with f, so that the noise does not.
      J[3] = row.r + row.to_px * (match.b_by_scale.dot(t_[k].cross(match.c)) +
                                  match.b.dot(t_[k].cross(match.c_by_scale)));
      J[4] = row.by_direction.dot(u);
      J[5] = row.by_direction.dot(v);
      H += weight * J * J.transpose();
      g += weight * row.r * J;
      if (!second_derivatives) continue;
      H_loss += weight * (1 - 3 * square) / (1 + square) * J * J.transpose();
    }
    H.bottomRightCorner<2, 2>().diagonal().array() +=
        std::pow(scale_px / kDirectionStep_rad, 2);
    const Eigen::Matrix2d inverse = H.bottomRightCorner<2, 2>().inverse();
    Equations equations;
    equations.d = inverse * g.tail<2>();
    // The unknowns of the pair for those of the start.
    Eigen::Matrix<double, 6, kStartSize> by_start;
    by_start.topRows<3>() = views_[k].by_start;
    by_start.row(3) = Vector8::Unit(kStartFocalScale).transpose();
    equations.D = inverse * H.bottomLeftCorner<2, 4>() * by_start.topRows<4>();
    by_start.bottomRows<2>() = -equations.D;
    equations.H =
        by_start.transpose() * (second_derivatives ? H_loss : H) * by_start;
    equations.g = by_start.transpose() * g;
    return equations;
  }

  // Information of the priors; a component that is held constant has so much
  // that nothing moves it.
  Vector8 PriorInformation() const {
    return prior_.sigmas.cwiseMax(1e-9).cwiseAbs2().cwiseInverse();
  }

  // Returns the length of the step in sigmas.
  double Step(double scale_px) {
    // Treated as if all residuals below the scale were noise.
    const double variance = std::pow(scale_px / kInlierSigmas, 2);
    const Vector8 prior = variance * PriorInformation();
    Matrix8 H = prior.asDiagonal();
    Vector8 g = prior.cwiseProduct(BoxMinus(at_, prior_.mean));
    std::vector<Equations> equations(pairs_.size());
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      if (!views_[k].covered) continue;
      equations[k] = PairEquations(k, scale_px, false);
      H += equations[k].H;
      g += equations[k].g;
    }
    const Vector8 step =
        (-H.ldlt().solve(g)).cwiseMax(-kMaxStep).cwiseMin(kMaxStep);
    at_ = BoxPlus(at_, step);
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      const Eigen::Vector2d direction = equations[k].d + equations[k].D * step;
      const Eigen::Vector3d u = t_[k].unitOrthogonal();
      const Eigen::Vector3d v = t_[k].cross(u);
      t_[k] = (t_[k] - direction[0] * u - direction[1] * v).normalized();
    }
    return std::sqrt(step.dot(H * step) / variance);
  }

  // That of an M-estimator: the scatter of the scores of pairs between the
  // inverses of the second derivatives. It holds for errors that a model of
  // noise does not have, such as those of a track; neighbours, which share an
  // image, are treated as independent.
  Matrix8 Covariance(double scale_px) const {
    const double variance = std::pow(scale_px / kInlierSigmas, 2);
    const Vector8 prior = variance * PriorInformation();
    Matrix8 H = Matrix8::Zero();
    Matrix8 scatter = Matrix8::Zero();
    int count = 0;
    for (std::size_t k = 0; k < pairs_.size(); ++k) {
      if (!views_[k].covered) continue;
      const Equations equations = PairEquations(k, scale_px, true);
      H += equations.H;
      scatter += equations.g * equations.g.transpose();
      ++count;
    }
    // The scores of an estimate scatter less than those of the truth.
    scatter *= count / std::max(1.0, static_cast<double>(count - kStartSize));
    H += prior.asDiagonal();
    scatter += (variance * prior).asDiagonal();
    const Matrix8 inverse = H.inverse();
    Matrix8 covariance = inverse * scatter * inverse.transpose();
    for (int i = 0; i < kStartSize; ++i) {
      if (prior_.sigmas[i] > 0) continue;
      covariance.row(i).setZero();
      covariance.col(i).setZero();
    }
    return covariance;
  }

  const StartPrior& prior_;
  RotationStart at_;
  const ImuCalibration& imu_;
  const std::span<const ImuSample> samples_;
  const std::vector<ImagePair>& pairs_;
  RayImages& rays_;
  std::vector<Eigen::Vector3d> t_;  // of each pair, in its second image
  std::vector<View> views_;
  double px_per_rad_ = 1;
};

}  // namespace

RotationStart RefineRotationStart(const RotationStart& begin,
                                  const StartPrior& prior,
                                  const ImuCalibration& imu,
                                  std::span<const ImuSample> samples,
                                  const std::vector<ImagePair>& pairs,
                                  RayImages* rays) {
  return Refiner(begin, prior, imu, samples, pairs, rays).Run();
}

Vector8 BoxMinus(const RotationStart& a, const RotationStart& b) {
  Vector8 delta;
  delta << Log(b.q_CI.conjugate() * a.q_CI), a.time_offset_s - b.time_offset_s,
      a.b_g - b.b_g, std::log(a.focal_scale / b.focal_scale);
  return delta;
}

RotationStart BoxPlus(const RotationStart& start, const Vector8& delta) {
  RotationStart moved = start;
  moved.q_CI =
      (start.q_CI * Exp(delta.segment<3>(kStartRotation))).normalized();
  moved.time_offset_s += delta[kStartTimeOffset];
  moved.b_g += delta.segment<3>(kStartGyroBias);
  moved.focal_scale *= std::exp(delta[kStartFocalScale]);
  return moved;
}

}  // namespace selfcal
