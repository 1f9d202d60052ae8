#include "core/initialisation/turn_alignment.h"

#include <algorithm>
#include <cmath>

#include "core/model/median.h"
#include "core/model/so3.h"
#include "core/model/symmetric_eigen.h"

namespace selfcal {
namespace {

constexpr double kStep_s = 0.01;
// Steps of the search beyond its range, so that a minimum at its end is one.
constexpr int kStepsBeyond = 3;
constexpr int kIterations = 8;
// Residuals count up to this share of the rotations.
constexpr double kTruncation = 1.0;

// A turn with that of the gyroscope over the same time.
struct TurnPair {
  double dt_s;
  Eigen::Vector3d camera_radps;
  Eigen::Vector3d body_radps;
};

struct Weighted {
  double sum = 0;
  Eigen::Vector3d camera = Eigen::Vector3d::Zero();  // means
  Eigen::Vector3d body = Eigen::Vector3d::Zero();

  Weighted(const std::vector<TurnPair>& pairs,
           const std::vector<double>& weights) {
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      sum += weights[i];
      camera += weights[i] * pairs[i].camera_radps;
      body += weights[i] * pairs[i].body_radps;
    }
    camera /= sum;
    body /= sum;
  }
};

Eigen::Matrix3d MeanSquare(const std::vector<TurnPair>& pairs,
                           const Eigen::Vector3d& mean) {
  Eigen::Matrix3d square = Eigen::Matrix3d::Zero();
  for (const TurnPair& pair : pairs) {
    const Eigen::Vector3d d = pair.body_radps - mean;
    square += d * d.transpose();
  }
  return square / static_cast<double>(pairs.size());
}

}  // namespace

TurnAlignment AlignTurns(const std::vector<VisualTurn>& turns,
                         const GyroRotation& gyro,
                         double first_s,
                         double last_s,
                         double offset_s,
                         const std::optional<Eigen::Quaterniond>& q_CI) {
  TurnAlignment found;
  found.offset_s = offset_s;
  std::vector<TurnPair> pairs;
  for (const VisualTurn& turn : turns) {
    const double from_s = turn.from_s + offset_s;
    const double to_s = turn.to_s + offset_s;
    if (from_s < first_s || to_s > last_s) continue;
    const double dt_s = to_s - from_s;
    pairs.push_back(
        {dt_s, turn.turn_C / dt_s, Log(gyro.Between(from_s, to_s)) / dt_s});
  }
  found.turns = static_cast<int>(pairs.size());
  if (pairs.empty()) return found;

  // The error of a turn does not depend on its duration.
  std::vector<double> weights, errors(pairs.size()), sizes;
  for (const TurnPair& pair : pairs) weights.push_back(pair.dt_s * pair.dt_s);
  Eigen::Vector3d b_I, mean_C;
  double variance = 0;
  for (int n = 0; n < kIterations; ++n) {
    const Weighted mean(pairs, weights);
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      moments += weights[i] * (pairs[i].camera_radps - mean.camera) *
                 (pairs[i].body_radps - mean.body).transpose();
    }
    found.q_CI = q_CI.value_or(RotationOfMoments(moments));
    b_I = mean.body - found.q_CI.conjugate() * mean.camera;
    mean_C = mean.camera;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      errors[i] = pairs[i].dt_s * (pairs[i].camera_radps -
                                   found.q_CI * (pairs[i].body_radps - b_I))
                                      .norm();
    }
    const double scale = std::max(2 * UpperMedian(errors), 1e-6);
    variance = 0;
    double sum = 0;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const double ratio = errors[i] / scale;
      const double weight = 1 / std::pow(1 + ratio * ratio, 2);
      variance += weight * errors[i] * errors[i] / 3;
      sum += weight;
      weights[i] = weight * pairs[i].dt_s * pairs[i].dt_s;
    }
    variance /= sum;
  }
  found.b_g = b_I;

  for (const TurnPair& pair : pairs) {
    sizes.push_back(pair.dt_s * (pair.camera_radps - mean_C).norm());
  }
  const double limit = std::max(kTruncation * UpperMedian(sizes), 1e-9);
  double left = 0, all = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    left += std::pow(std::min(errors[i], limit), 2);
    all += std::pow(std::min(sizes[i], limit), 2);
  }
  found.share = all > 0 ? left / all : 1;

  const Weighted mean(pairs, weights);
  double product = 0, squares = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector3d body = found.q_CI * (pairs[i].body_radps - mean.body);
    const Eigen::Vector3d camera = pairs[i].camera_radps - mean.camera;
    product += weights[i] * body.head<2>().dot(camera.head<2>());
    squares += weights[i] * body.head<2>().squaredNorm();
  }
  found.focal_ratio = squares > 0 ? product / squares : 1;
  const Eigen::Vector3d square =
      SymmetricEigenvalues(MeanSquare(pairs, mean.body)).cwiseMax(0);
  found.speed_radps = std::sqrt(square.sum());
  found.other_axes_radps = std::sqrt(square[0] + square[1]);
  double information = 0;  // about the axis with most of the rotation
  for (const double weight : weights) information += weight;
  information *= square[0] + square[1];
  found.rotation_sigma_rad =
      std::sqrt(variance / std::max(information, 1e-300));
  return found;
}

std::vector<TurnAlignment> SearchOffsets(
    const std::vector<VisualTurn>& turns,
    const GyroRotation& gyro,
    double first_s,
    double last_s,
    double centre_s,
    double range_s,
    const std::optional<Eigen::Quaterniond>& q_CI) {
  const int steps =
      static_cast<int>(std::ceil(range_s / kStep_s)) + kStepsBeyond;
  std::vector<TurnAlignment> all;
  for (int n = -steps; n <= steps; ++n) {
    all.push_back(
        AlignTurns(turns, gyro, first_s, last_s, centre_s + n * kStep_s, q_CI));
  }
  int most = 0;
  for (const TurnAlignment& at : all) most = std::max(most, at.turns);
  for (TurnAlignment& at : all) {
    if (2 * at.turns < most) at.share = 1;
  }
  std::vector<TurnAlignment> minima;
  for (std::size_t n = 0; n < all.size(); ++n) {
    if (n > 0 && all[n - 1].share < all[n].share) continue;
    if (n + 1 < all.size() && all[n + 1].share <= all[n].share) continue;
    minima.push_back(all[n]);
  }
  std::ranges::stable_sort(minima, {}, &TurnAlignment::share);
  return minima;
}

}  // namespace selfcal
