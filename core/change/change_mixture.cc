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
                        MatrixXd by_change,
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
  const double log_constant = std::log(no_change_);
  double largest = log_constant;
  for (const Hypothesis& one : hypotheses_) {
    largest = std::max(largest, one.log_weight);
  }
  double total = std::exp(log_constant - largest);
  double changed = 0;
  const Eigen::Index size = hypotheses_.front().by_change.rows();
  VectorXd step = VectorXd::Zero(size);
  MatrixXd moment = MatrixXd::Zero(size, size);
  for (const Hypothesis& one : hypotheses_) {
    const double weight = std::exp(one.log_weight - largest);
    changed += weight;
    step += weight * (one.by_change * one.mean);
    moment += weight * one.by_change *
              (one.covariance + one.mean * one.mean.transpose()) *
              one.by_change.transpose();
  }
  total += changed;
  step /= total;
  moment /= total;
  return {changed / total, step, moment - step * step.transpose()};
}

}  // namespace selfcal
