#include "client/tracking/patch_template.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

namespace selfcal::client {
namespace {

constexpr int kMaxTemplateSteps = 12;
constexpr double kConverged_px = 0.003;
constexpr double kMaxMove_px = 3;
constexpr double kWeightSigma_px = 5;
// Damping of a step of A, relative to the information of a patch of strong
// gradients: parts of A that the patch does not show stay as predicted.
constexpr double kDamping = 2e-3;
constexpr double kMaxWarpNorm = 3;

// Grey at a place inside the image, interpolated.
float GreyAt(const cv::Mat& image, float x, float y) {
  const int column = static_cast<int>(x);
  const int row = static_cast<int>(y);
  const float a = x - static_cast<float>(column);
  const float b = y - static_cast<float>(row);
  const std::uint8_t* top = image.ptr<std::uint8_t>(row) + column;
  const std::uint8_t* bottom = image.ptr<std::uint8_t>(row + 1) + column;
  const float t = top[0] + a * static_cast<float>(top[1] - top[0]);
  const float s = bottom[0] + a * static_cast<float>(bottom[1] - bottom[0]);
  return t + b * (s - t);
}

}  // namespace

PatchTemplate::PatchTemplate(const cv::Mat& image,
                             const Eigen::Vector2d& z_px,
                             const PatchPlane& plane)
    : plane_(plane) {
  Eigen::Matrix<float, kPixels, kParameters> derivatives;
  int i = 0;
  for (int dy = -kReach_px; dy <= kReach_px; ++dy) {
    for (int dx = -kReach_px; dx <= kReach_px; ++dx, ++i) {
      const auto x = static_cast<float>(z_px.x() + dx);
      const auto y = static_cast<float>(z_px.y() + dy);
      const float gx = (GreyAt(image, x + 1, y) - GreyAt(image, x - 1, y)) / 2;
      const float gy = (GreyAt(image, x, y + 1) - GreyAt(image, x, y - 1)) / 2;
      const auto fx = static_cast<float>(dx);
      const auto fy = static_cast<float>(dy);
      greys_[i] = GreyAt(image, x, y);
      weights_[i] = static_cast<float>(std::exp(
          -0.5 * (dx * dx + dy * dy) / (kWeightSigma_px * kWeightSigma_px)));
      derivatives.row(i) << gx * fx, gx * fy, gy * fx, gy * fy, gx, gy,
          greys_[i], 1;
    }
  }
  weights_ /= weights_.sum();
  weighted_ = weights_.asDiagonal() * derivatives;
  Eigen::Matrix<double, kParameters, kParameters> information =
      (weighted_.transpose() * derivatives).cast<double>();
  const double gradients = information(4, 4) + information(5, 5);
  information.diagonal().head<4>().array() +=
      kDamping * gradients * kReach_px * kReach_px + 1e-6;
  information.diagonal().tail<4>().array() += 1e-6;
  inverse_ = information.inverse();
}

bool PatchTemplate::Sample(const cv::Mat& image,
                           const PatchWarp& warp,
                           const LensCurvature& bend,
                           Values* values) const {
  const Eigen::Vector2d reach =
      kReach_px * warp.A.cwiseAbs().rowwise().sum() +
      kReach_px * kReach_px * bend.cwiseAbs().rowwise().sum();
  // False for NaN, too; the margin is for rounding.
  constexpr double kMargin = 0.01;
  const bool inside = warp.z_px.x() - reach.x() > kMargin &&
                      warp.z_px.y() - reach.y() > kMargin &&
                      warp.z_px.x() + reach.x() < image.cols - 1 - kMargin &&
                      warp.z_px.y() + reach.y() < image.rows - 1 - kMargin;
  if (!inside) return false;
  const Eigen::Matrix2f A = warp.A.cast<float>();
  const Eigen::Vector2f z = warp.z_px.cast<float>();
  const Eigen::Matrix<float, 2, 3> Q = bend.cast<float>();
  int i = 0;
  for (int dy = -kReach_px; dy <= kReach_px; ++dy) {
    const auto fy = static_cast<float>(dy);
    const Eigen::Vector2f row = z + fy * A.col(1) + fy * fy * Q.col(2);
    const Eigen::Vector2f by_x = A.col(0) + fy * Q.col(1);
    for (int dx = -kReach_px; dx <= kReach_px; ++dx, ++i) {
      const auto fx = static_cast<float>(dx);
      const Eigen::Vector2f place = row + fx * by_x + fx * fx * Q.col(0);
      (*values)[i] = GreyAt(image, place.x(), place.y());
    }
  }
  return true;
}

double PatchTemplate::Align(const cv::Mat& image,
                            const PatchPlane& plane,
                            PatchWarp* warp) const {
  const auto sample = [&](const PatchWarp& w, Values* values) {
    return Sample(image, w, SecondOrderOfWarp(plane_, w.A, plane), values);
  };
  PatchWarp w = *warp;
  Values sampled;
  double gain = 1;
  double offset = 0;
  bool converged = false;
  for (int k = 0; k < kMaxTemplateSteps && !converged; ++k) {
    if (!sample(w, &sampled)) return 0;
    const Values residuals = sampled - static_cast<float>(gain) * greys_ -
                             Values::Constant(static_cast<float>(offset));
    const Eigen::Matrix<double, kParameters, 1> step =
        inverse_ * (weighted_.transpose() * residuals).cast<double>();
    gain += step[6];
    offset += step[7];
    if (!(gain > 0.1)) return 0;
    // The patch itself would be warped by (I + dA) x + dz to look like the
    // image: the warp is followed by the inverse of that. The gradients of the
    // image are those of the patch times the gain.
    Eigen::Matrix2d dA;
    dA << step[0], step[1], step[2], step[3];
    w.A *= (Eigen::Matrix2d::Identity() + dA / gain).inverse();
    const Eigen::Vector2d moved = -(w.A * step.segment<2>(4)) / gain;
    w.z_px += moved;
    if (!((w.z_px - warp->z_px).norm() < kMaxMove_px) ||
        !(w.A.norm() < kMaxWarpNorm)) {
      return 0;
    }
    converged = moved.norm() < kConverged_px;
  }
  if (!converged || !sample(w, &sampled)) return 0;
  const float mean_a = weights_.dot(greys_);
  const float mean_b = weights_.dot(sampled);
  const Values a = greys_ - Values::Constant(mean_a);
  const Values b = sampled - Values::Constant(mean_b);
  const double product = weights_.dot(a.cwiseProduct(b));
  const double squares =
      weights_.dot(a.cwiseProduct(a)) * weights_.dot(b.cwiseProduct(b));
  if (!(squares > 0)) return 0;
  *warp = w;
  return product / std::sqrt(squares);
}

}  // namespace selfcal::client
