// Uniform quintic B-spline of position and quaternion.
//
// Both are sums of basis functions B_j over control points, x(t) = sum B_j c_j:
// the position as it is, the quaternion normalised, q(t) = x / |x|, from which
//   q' = (x' - q (q . x')) / |x|,   w_I = 2 vec(q^-1 q')
// exactly. The control points minimise the squared distance to the poses, plus
// a small multiple of the squared third differences, which bridges the gaps.
#include <fmt/format.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/simulation/trajectory.h"

namespace selfcal {
namespace {

constexpr int kOrder = 6;  // control points for each instant
// Weight of the squared third differences, in poses for each knot. Small
// against the weakest response of the basis (0.066 squared, at half the
// frequency of the knots), so that only what the poses leave open is smoothed.
constexpr double kSmoothing = 1e-5;

using Weights = Eigen::Matrix<double, kOrder, 1>;
// Position and quaternion (x, y, z, w) of each control point.
using ControlPoints = Eigen::Matrix<double, Eigen::Dynamic, 7>;

// The basis functions on one knot interval, u in [0, 1], times 120: rows are
// control points, columns powers of u.
Eigen::Matrix<double, kOrder, kOrder> BasisCoefficients() {
  Eigen::Matrix<double, kOrder, kOrder> basis;
  basis << 1, -5, 10, -10, 5, -1,  //
      26, -50, 20, 20, -20, 5,     //
      66, 0, -60, 0, 30, -10,      //
      26, 50, 20, -20, -20, 10,    //
      1, 5, 10, 10, 5, -5,         //
      0, 0, 0, 0, 0, 1;
  return basis / 120;
}

// Values of the basis, and of its derivatives by t.
struct Basis {
  std::ptrdiff_t first;  // control point of the first weight
  Weights b0, b1, b2;
};

class KnotGrid {
 public:
  KnotGrid(double duration_s, double spacing_s)
      : intervals_(std::max(1L, std::lround(duration_s / spacing_s))),
        spacing_s_(duration_s / static_cast<double>(intervals_)) {}

  std::ptrdiff_t ControlPointCount() const { return intervals_ + kOrder - 1; }

  Basis At(double t_s) const {
    const double x = t_s / spacing_s_;
    Basis basis;
    basis.first = std::clamp<std::ptrdiff_t>(
        static_cast<std::ptrdiff_t>(x), 0, intervals_ - 1);
    const double u = x - static_cast<double>(basis.first);
    Weights p0, p1 = Weights::Zero(), p2 = Weights::Zero();
    p0[0] = 1;
    for (int n = 1; n < kOrder; ++n) p0[n] = p0[n - 1] * u;
    for (int n = 1; n < kOrder; ++n) p1[n] = n * p0[n - 1];
    for (int n = 2; n < kOrder; ++n) p2[n] = n * p1[n - 1];
    static const Eigen::Matrix<double, kOrder, kOrder> kBasis =
        BasisCoefficients();
    basis.b0 = kBasis * p0;
    basis.b1 = kBasis * p1 / spacing_s_;
    basis.b2 = kBasis * p2 / (spacing_s_ * spacing_s_);
    return basis;
  }

 private:
  std::ptrdiff_t intervals_;
  double spacing_s_;
};

// Empty if the poses can be fitted, or why not.
std::string CheckPoses(const std::vector<TimedPose>& poses,
                       const SplineOptions& options) {
  if (!(options.knot_spacing_s > 0)) return "knot_spacing_s must be positive";
  if (poses.size() < 4) {
    return fmt::format("{} poses; a spline needs at least 4", poses.size());
  }
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const TimedPose& pose = poses[i];
    if (!std::isfinite(pose.t_s) || !pose.p_GI.allFinite() ||
        !(std::abs(pose.q_GI.norm() - 1) < 1e-3)) {
      return fmt::format("pose {} is not finite, or not a unit quaternion", i);
    }
    if (i == 0) continue;
    const double dt_s = pose.t_s - poses[i - 1].t_s;
    if (!(dt_s > 0)) {
      return fmt::format(
          "pose {} at {} s is not later than the one before", i, pose.t_s);
    }
    if (dt_s > options.max_gap_s) {
      return fmt::format(
          "gap of {:.3f} s before pose {} at {} s", dt_s, i, pose.t_s);
    }
    if (std::abs(pose.q_GI.dot(poses[i - 1].q_GI)) < std::cos(M_PI_4)) {
      return fmt::format(
          "turn of more than 90 degrees before pose {} at {} s", i, pose.t_s);
    }
  }
  return {};
}

// Normal equations of the least-squares fit.
ControlPoints Fit(const std::vector<TimedPose>& poses, const KnotGrid& grid) {
  const std::ptrdiff_t n = grid.ControlPointCount();
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(poses.size() * kOrder * kOrder + 16 * n);
  ControlPoints right = ControlPoints::Zero(n, 7);
  Eigen::Vector4d last_q = poses.front().q_GI.coeffs();
  for (const TimedPose& pose : poses) {
    // q and -q are one rotation: keep to the side of the one before.
    Eigen::Vector4d q = pose.q_GI.coeffs();
    if (q.dot(last_q) < 0) q = -q;
    last_q = q;
    Eigen::Matrix<double, 1, 7> value;
    value << pose.p_GI.transpose(), q.transpose();
    const Basis basis = grid.At(pose.t_s - poses.front().t_s);
    for (int i = 0; i < kOrder; ++i) {
      right.row(basis.first + i) += basis.b0[i] * value;
      for (int j = 0; j < kOrder; ++j) {
        entries.emplace_back(
            basis.first + i, basis.first + j, basis.b0[i] * basis.b0[j]);
      }
    }
  }
  const double weight =
      kSmoothing * static_cast<double>(poses.size()) / static_cast<double>(n);
  const std::array<double, 4> difference = {-1, 3, -3, 1};
  for (std::ptrdiff_t k = 0; k + 3 < n; ++k) {
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) {
        entries.emplace_back(
            k + i, k + j, weight * difference[i] * difference[j]);
      }
    }
  }
  Eigen::SparseMatrix<double> left(n, n);
  left.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(left);
  return solver.solve(right);
}

class SplineTrajectory : public Trajectory {
 public:
  SplineTrajectory(double duration_s, KnotGrid grid, ControlPoints control)
      : duration_s_(duration_s), grid_(grid), control_(std::move(control)) {}

  double duration_s() const override { return duration_s_; }

  BodyMotion At(double t_s) const override {
    const Basis basis = grid_.At(t_s);
    const auto c = control_.middleRows<kOrder>(basis.first);
    const Eigen::Matrix<double, 7, 1> x0 = c.transpose() * basis.b0;
    const Eigen::Matrix<double, 7, 1> x1 = c.transpose() * basis.b1;
    const double norm = x0.tail<4>().norm();
    const Eigen::Vector4d q = x0.tail<4>() / norm;
    const Eigen::Vector4d dq = x1.tail<4>();
    BodyMotion motion;
    motion.q_GI = Eigen::Quaterniond(q);
    motion.p_GI = x0.head<3>();
    motion.v_GI = x1.head<3>();
    motion.a_GI = c.leftCols<3>().transpose() * basis.b2;
    const Eigen::Quaterniond q_dot(
        Eigen::Vector4d((dq - q * q.dot(dq)) / norm));
    motion.w_I = 2 * (motion.q_GI.conjugate() * q_dot).vec();
    return motion;
  }

 private:
  double duration_s_;
  KnotGrid grid_;
  ControlPoints control_;
};

}  // namespace

std::unique_ptr<Trajectory> MakeSpline(const std::vector<TimedPose>& poses,
                                       const SplineOptions& options,
                                       std::string* error) {
  const std::string problem = CheckPoses(poses, options);
  if (!problem.empty()) {
    if (error != nullptr) *error = problem;
    return nullptr;
  }
  const double duration_s = poses.back().t_s - poses.front().t_s;
  const KnotGrid grid(duration_s, options.knot_spacing_s);
  return std::make_unique<SplineTrajectory>(duration_s, grid, Fit(poses, grid));
}

}  // namespace selfcal
