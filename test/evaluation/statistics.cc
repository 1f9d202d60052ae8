#include "test/evaluation/statistics.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/change/chi_square.h"
#include "core/model/so3.h"

namespace selfcal {
namespace {

// Ranks from 1, ties with their mean.
std::vector<double> Ranks(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return values[a] < values[b];
  });
  std::vector<double> ranks(values.size());
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin;
    while (end < order.size() && values[order[end]] == values[order[begin]]) {
      ++end;
    }
    const double rank = 0.5 * static_cast<double>(begin + 1 + end);
    for (std::size_t i = begin; i < end; ++i) ranks[order[i]] = rank;
    begin = end;
  }
  return ranks;
}

// Of exactly so many hits; 0 < p < 1.
double BinomialChance(int hits, int trials, double p) {
  return std::exp(std::lgamma(trials + 1.0) - std::lgamma(hits + 1.0) -
                  std::lgamma(trials - hits + 1.0) + hits * std::log(p) +
                  (trials - hits) * std::log1p(-p));
}

}  // namespace

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) /
         static_cast<double>(values.size());
}

double Rms(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

double Quantile(std::vector<double> values, double p) {
  std::sort(values.begin(), values.end());
  const double at = p * static_cast<double>(values.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const std::size_t high = std::min(low + 1, values.size() - 1);
  const double part = at - static_cast<double>(low);
  return (1 - part) * values[low] + part * values[high];
}

double MedianOf(const std::vector<double>& values) {
  return Quantile(values, 0.5);
}

double StandardDeviation(const std::vector<double>& values) {
  const double mean = Mean(values);
  double sum = 0;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return std::sqrt(sum / static_cast<double>(values.size() - 1));
}

double RankCorrelation(const std::vector<double>& a,
                       const std::vector<double>& b) {
  const std::vector<double> ranks_a = Ranks(a);
  const std::vector<double> ranks_b = Ranks(b);
  const double mean = 0.5 * static_cast<double>(a.size() + 1);
  double aa = 0;
  double bb = 0;
  double ab = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double da = ranks_a[i] - mean;
    const double db = ranks_b[i] - mean;
    aa += da * da;
    bb += db * db;
    ab += da * db;
  }
  return ab / std::sqrt(aa * bb);
}

double ChiSquareQuantile(double p, int dof) {
  double low = 0;
  double high = dof + 1;
  while (ChiSquareTail(high, dof) > 1 - p) high *= 2;
  while (high - low > 1e-12 * high) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (ChiSquareTail(middle, dof) > 1 - p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

SquaredError NormalisedSquaredError(const Eigen::VectorXd& error,
                                    const Eigen::MatrixXd& covariance) {
  std::vector<int> estimated;
  for (int i = 0; i < error.size(); ++i) {
    if (covariance(i, i) != 0) estimated.push_back(i);
  }
  const Eigen::VectorXd sigma = covariance.diagonal()(estimated).cwiseSqrt();
  const Eigen::VectorXd z = error(estimated).cwiseQuotient(sigma);
  const Eigen::VectorXd scale = sigma.cwiseInverse();
  const Eigen::MatrixXd correlation = scale.asDiagonal() *
                                      covariance(estimated, estimated) *
                                      scale.asDiagonal();
  return {z.dot(correlation.ldlt().solve(z)),
          static_cast<int>(estimated.size())};
}

double BinomialTail(int count, int trials, double rate) {
  double below = 0;
  for (int k = 0; k < count; ++k) {
    below += BinomialChance(k, trials, rate);
  }
  return std::max(0.0, 1 - below);
}

double BinomialUpperBound(int count, int trials, double probability) {
  if (count >= trials) return 1;
  double low = 0, high = 1;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    const bool likely = BinomialTail(count + 1, trials, middle) < probability;
    (likely ? low : high) = middle;
  }
  return high;
}

std::pair<double, double> NeesBounds(int dof, int runs, double probability) {
  const double tail = 0.5 * (1 - probability);
  return {ChiSquareQuantile(tail, dof * runs) / runs,
          ChiSquareQuantile(1 - tail, dof * runs) / runs};
}

std::pair<int, int> BinomialBounds(int runs, double p, double probability) {
  const double tail = (1 - probability) / 2;
  const auto chance = [&](int hits) { return BinomialChance(hits, runs, p); };
  int low = 0;
  for (double below = chance(low); below < tail; below += chance(low)) ++low;
  int high = runs;
  for (double above = chance(high); above < tail; above += chance(high)) --high;
  return {low, high};
}

Eigen::Quaterniond AverageRotation(
    const std::vector<Eigen::Quaterniond>& rotations) {
  Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
  for (const Eigen::Quaterniond& q : rotations) {
    sum += q.coeffs() * q.coeffs().transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(sum);
  return Eigen::Quaterniond(Eigen::Vector4d(solver.eigenvectors().col(3)));
}

RotationSpread SpreadOfRotations(
    const std::vector<Eigen::Quaterniond>& rotations) {
  const Eigen::Quaterniond mean = AverageRotation(rotations);
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  for (const Eigen::Quaterniond& q : rotations) {
    squares += Log(mean.conjugate() * q).cwiseAbs2();
  }
  squares /= static_cast<double>(rotations.size() - 1);
  return {squares.cwiseSqrt(), std::sqrt(squares.sum())};
}

}  // namespace selfcal
