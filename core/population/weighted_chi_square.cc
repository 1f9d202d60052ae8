#include "core/population/weighted_chi_square.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace selfcal {
namespace {

double NormalTail(double x) { return 0.5 * std::erfc(x / std::numbers::sqrt2); }

double NormalDensity(double x) {
  return std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi);
}

// The cumulant generating function K of the sum, and its derivatives.
struct Cumulants {
  double value = 0;
  double first = 0;
  double second = 0;
};

Cumulants CumulantsAt(double s, const std::vector<double>& weights) {
  Cumulants K;
  for (const double weight : weights) {
    const double scaled = weight / (1 - 2 * weight * s);
    K.value -= 0.5 * std::log1p(-2 * weight * s);
    K.first += scaled;
    K.second += 2 * scaled * scaled;
  }
  return K;
}

// The s at which K' is the statistic. K' is between that of the largest weight
// alone and that of as many weights of its size.
double SaddlePoint(double statistic, const std::vector<double>& weights) {
  constexpr int kHalvings = 100;
  const double pole = 0.5 / *std::max_element(weights.begin(), weights.end());
  double near = 0.5 / statistic;  // distances from the pole
  double far = static_cast<double>(weights.size()) * near;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (near + far);
    const bool is_beyond =
        CumulantsAt(pole - middle, weights).first < statistic;
    (is_beyond ? far : near) = middle;
  }
  return pole - 0.5 * (near + far);
}

}  // namespace

double WeightedChiSquareTail(double statistic, const Eigen::ArrayXd& weights) {
  std::vector<double> positive;
  for (const double weight : weights) {
    if (weight > 0) positive.push_back(weight);
  }
  if (positive.empty() || statistic <= 0) return 1;
  const double s = SaddlePoint(statistic, positive);
  const Cumulants K = CumulantsAt(s, positive);
  const double r =
      std::copysign(std::sqrt(2 * std::max(0.0, s * statistic - K.value)), s);
  if (std::abs(r) < 1e-4) {  // at the mean, where both terms below diverge
    double second = 0;
    double third = 0;
    for (const double weight : positive) {
      second += 2 * weight * weight;
      third += 8 * weight * weight * weight;
    }
    return 0.5 - third / (6 * std::sqrt(2 * std::numbers::pi) *
                          std::pow(second, 1.5));
  }
  const double v = s * std::sqrt(K.second);
  const double tail = NormalTail(r) + NormalDensity(r) * (1 / v - 1 / r);
  return std::clamp(tail, 0.0, 1.0);
}

}  // namespace selfcal
