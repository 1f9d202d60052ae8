// How much more segments differ from each other than their information says.
// Pure, deterministic, any thread.
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

  // The squares by which segments differ from a change within the span of B
  // that took this course, over their degrees: the median of all, or of those
  // of weight > 0 if that is larger, and at least 1. The noise of the segments
  // is so many times what they claim.
  double Of(const Eigen::VectorXd& weights,
            const Course& course,
            const Eigen::MatrixXd& B) const;

 private:
  // Of the directions that a segment observes, in units of their noise.
  struct Whitened {
    Eigen::MatrixXd by_offset;
    Eigen::VectorXd values;
  };
  std::vector<Whitened> segments_;
};

}  // namespace selfcal
