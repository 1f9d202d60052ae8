#include "core/change/change_mixture.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/change/sized_change.h"

namespace selfcal {

using Eigen::MatrixXd;
using Eigen::VectorXd;

void ChangeMixture::Add(const MatrixXd& L,
                        const VectorXd& s,
                        const MatrixXd& by_change,
                        double prior) {
  no_change_ -= prior;
  const double each = prior / static_cast<double>(kChangeSizes.size());
  for (const double size : kChangeSizes) {
    SizedChange of_size = ChangeOfSize(L, s, size);
    hypotheses_.push_back({std::log(each) + of_size.log_evidence,
                           by_change,
                           std::move(of_size.mean),
                           std::move(of_size.covariance)});
  }
}

ChangeDoubt ChangeMixture::Doubt() const {
  double largest = std::log(no_change_);
  for (const Hypothesis& one : hypotheses_) {
    largest = std::max(largest, one.log_weight);
  }
  const double no_change = no_change_ * std::exp(-largest);
  const auto weight = [&](const Hypothesis& one) {
    return std::exp(one.log_weight - largest);
  };
  const Eigen::Index size = hypotheses_.front().by_change.rows();
  ChangeDoubt doubt{0, VectorXd::Zero(size), MatrixXd::Zero(size, size)};
  double changed = 0;
  for (const Hypothesis& one : hypotheses_) {
    changed += weight(one);
    doubt.step += weight(one) * (one.by_change * one.mean);
  }
  const double total = no_change + changed;
  doubt.probability = changed / total;
  doubt.step /= total;
  // Moments about the mean are a sum of squares, which stays semidefinite
  // despite rounding.
  doubt.covariance = no_change * doubt.step * doubt.step.transpose();
  for (const Hypothesis& one : hypotheses_) {
    const VectorXd from_mean = one.by_change * one.mean - doubt.step;
    doubt.covariance += weight(one) * (one.by_change * one.covariance *
                                           one.by_change.transpose() +
                                       from_mean * from_mean.transpose());
  }
  doubt.covariance /= total;
  return doubt;
}

}  // namespace selfcal
