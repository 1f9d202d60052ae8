// Ratio of the differences among segments to those that their information
// predicts. Pure, deterministic, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/change/consistency.h"
#include "core/change/course.h"

namespace selfcal {

class Heterogeneity {
 public:
  explicit Heterogeneity(std::span<const OffsetInformation> segments);

  // Squared differences of segments from a change within the span of B with
  // this course, over their degrees of freedom: the median of all, or of those
  // of weight > 0 if that is larger, and at least 1. The variance of the
  // segments is this many times what they claim.
  double Of(const Eigen::VectorXd& weights,
            const Course& course,
            const Eigen::MatrixXd& B) const;

 private:
  // Values of the directions that a segment observes, in units of their noise.
  struct Whitened {
    Eigen::MatrixXd by_offset;
    Eigen::VectorXd values;
  };
  std::vector<Whitened> segments_;
};

}  // namespace selfcal
