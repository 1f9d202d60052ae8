#include "core/initialisation/epipolar_check.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "core/initialisation/epipolar_row.h"
#include "core/model/median.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

// Steps at each scale of the residuals, and the ratio of two scales.
constexpr int kSteps = 3;
constexpr double kNextEpipolarScale = 0.6;
// Sigma of the direction from which a refinement begins: distant points do not
// determine it.
constexpr double kDirectionSigma_rad = 0.3;
constexpr double kSigmas = 3.5;
// A point that has moved against its parallax by more than this is behind a
// camera.
constexpr double kMaxBackward_px = 3;

class Fitter {
 public:
  Fitter(const std::vector<RayPair>& pairs,
         const Eigen::Quaterniond& q_BA,
         const EpipolarOptions& options)
      : pairs_(pairs), options_(options), q_(q_BA), given_(q_BA) {
    Rotate();
  }

  void set_direction(const Eigen::Vector3d& t_B) { t_ = t_B.normalized(); }

  // Distance of each match from its epipolar plane [px].
  double Distance(std::size_t i) const {
    const Eigen::Vector3d normal = t_.cross(rotated_[i]);
    const double length = normal.norm();
    if (length < 1e-9) return 0;
    return options_.px_per_rad * pairs_[i].b.dot(normal) / length;
  }

  // The direction on which most matches agree.
  void SearchDirection(double threshold_px) {
    std::mt19937_64 engine(options_.seed);
    double best = std::numeric_limits<double>::infinity();
    Eigen::Vector3d best_t = t_;
    for (int k = 0; k < options_.iterations; ++k) {
      const std::size_t i = engine() % pairs_.size();
      const std::size_t j = engine() % pairs_.size();
      const Eigen::Vector3d normal_i = rotated_[i].cross(pairs_[i].b);
      const Eigen::Vector3d normal_j = rotated_[j].cross(pairs_[j].b);
      const Eigen::Vector3d t = normal_i.cross(normal_j);
      const double length = t.norm();
      if (i == j || length < 1e-12) continue;
      t_ = t / length;
      double cost = 0;
      for (std::size_t n = 0; n < pairs_.size(); ++n) {
        cost += std::min(std::abs(Distance(n)), threshold_px);
      }
      if (cost < best) {
        best = cost;
        best_t = t_;
      }
    }
    t_ = best_t;
  }

  // Gauss-Newton steps on the direction and on the correction of the rotation,
  // with Geman-McClure weights whose scale shrinks: what agrees with no motion
  // loses its influence step by step (graduated non-convexity, Yang et al.
  // 2020).
  void Refine(double from_px, double to_px) {
    given_t_ = t_;
    for (double scale_px = from_px; scale_px > to_px;
         scale_px *= kNextEpipolarScale) {
      for (int k = 0; k < kSteps; ++k) Step(scale_px);
    }
    for (int k = 0; k < kSteps; ++k) Step(to_px);
  }

  double RobustSigma() const {
    std::vector<double> distances;
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      distances.push_back(std::abs(Distance(i)));
    }
    return kMadToSigma * UpperMedian(distances);
  }

  // Half of the matches, or all, lie in front if t points the right way.
  void OrientDirection() {
    double forward = 0;
    for (std::size_t i = 0; i < pairs_.size(); ++i) forward += Parallax(i);
    if (forward < 0) t_ = -t_;
  }

  EpipolarFit Result(double threshold_px) const {
    EpipolarFit fit{{}, q_, t_};
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      fit.inliers.push_back(std::abs(Distance(i)) <= threshold_px &&
                            options_.px_per_rad * Parallax(i) >=
                                -std::max(kMaxBackward_px, threshold_px));
    }
    return fit;
  }

 private:
  void Rotate() {
    rotated_.clear();
    for (const RayPair& pair : pairs_) rotated_.push_back(q_ * pair.a);
  }

  // Motion of a ray towards t [rad], positive for a point in front of both.
  double Parallax(std::size_t i) const {
    const Eigen::Vector3d& c = rotated_[i];
    const Eigen::Vector3d towards = t_ - t_.dot(c) * c;
    const double length = towards.norm();
    return length < 1e-9 ? 0 : (pairs_[i].b - c).dot(towards) / length;
  }

  void Step(double scale_px) {
    using Vector5 = Eigen::Matrix<double, 5, 1>;
    using Matrix5 = Eigen::Matrix<double, 5, 5>;
    const Eigen::Vector3d u = t_.unitOrthogonal();
    const Eigen::Vector3d v = t_.cross(u);
    Matrix5 H = Matrix5::Zero();
    Vector5 g = Vector5::Zero();
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      EpipolarRow row;
      if (!MakeEpipolarRow(
              t_, rotated_[i], pairs_[i].b, options_.px_per_rad, &row)) {
        continue;
      }
      const double ratio = row.r / scale_px;
      const double weight = 1 / std::pow(1 + ratio * ratio, 2);
      Vector5 J;
      J << row.by_rotation, row.by_direction.dot(u), row.by_direction.dot(v);
      H += weight * J * J.transpose();
      g += weight * row.r * J;
    }
    const double prior = std::pow(scale_px / options_.rotation_sigma_rad, 2);
    const Eigen::Vector3d offset = Log(q_ * given_.conjugate());
    H.topLeftCorner<3, 3>().diagonal().array() += prior;
    g.head<3>() += prior * offset;
    const double direction_prior = std::pow(scale_px / kDirectionSigma_rad, 2);
    H.bottomRightCorner<2, 2>().diagonal().array() += direction_prior;
    g[3] -= direction_prior * given_t_.dot(u);
    g[4] -= direction_prior * given_t_.dot(v);
    const Vector5 step = -H.ldlt().solve(g);
    q_ = (Exp(step.head<3>()) * q_).normalized();
    t_ = (t_ + step[3] * u + step[4] * v).normalized();
    Rotate();
  }

  const std::vector<RayPair>& pairs_;
  const EpipolarOptions& options_;
  Eigen::Quaterniond q_;
  const Eigen::Quaterniond given_;
  Eigen::Vector3d t_ = Eigen::Vector3d::UnitX();
  Eigen::Vector3d given_t_ = t_;
  std::vector<Eigen::Vector3d> rotated_;
};

}  // namespace

EpipolarFit CheckEpipolar(const std::vector<RayPair>& pairs,
                          const Eigen::Quaterniond& q_BA,
                          const EpipolarOptions& options,
                          const std::optional<Eigen::Vector3d>& t_B) {
  if (static_cast<int>(pairs.size()) < kMinEpipolarPairs) {
    return {std::vector<char>(pairs.size(), 1),
            q_BA,
            t_B.value_or(Eigen::Vector3d::UnitX())};
  }
  std::vector<double> flows;
  for (const RayPair& pair : pairs) {
    flows.push_back((pair.b - pair.a).norm() * options.px_per_rad);
  }
  const double coarse_px =
      2 * options.max_distance_px + options.flow_share * UpperMedian(flows);
  const double fine_px = options.max_distance_px / 2;
  Fitter fitter(pairs, q_BA, options);
  if (t_B) {
    // Matches are far from their planes if the calibration is wrong.
    fitter.set_direction(*t_B);
    fitter.Refine(std::max(coarse_px, 3 * fitter.RobustSigma()), fine_px);
  } else {
    fitter.SearchDirection(coarse_px);
    fitter.Refine(coarse_px, fine_px);
  }
  fitter.OrientDirection();
  return fitter.Result(
      std::max(options.max_distance_px, kSigmas * fitter.RobustSigma()));
}

}  // namespace selfcal
