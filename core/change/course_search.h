// Searches for a change over courses and parts of parameters. Detection
// (detect_change.h) and the test of a set (core/calibration/memory_split.h)
// share it.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "core/change/consistency.h"
#include "core/change/course.h"
#include "core/change/heterogeneity.h"

namespace selfcal {

struct FoundCourse {
  Eigen::VectorXd weights;  // of the segments
  const ThetaPart* part = nullptr;
  ConsistencyTest
      test;  // with the noise estimated from differences of segments
  double without_one = 1;  // largest probability with one segment excluded
  double heterogeneity = 1;
  double evidence = 0;  // ln of the likelihood ratio for the change
};

// Not thread-safe. Tester and segments must outlive it.
class CourseSearch {
 public:
  // A test must be less probable than the share of its part in `level`, with
  // the noise estimated from the differences among the segments, and with any
  // one of them excluded.
  CourseSearch(const ConsistencyTester& tester,
               std::span<const OffsetInformation> segments,
               double level)
      : tester_(tester), segments_(segments), level_(level) {}

  // Tests a course; `course` is that of the segments with these weights.
  void Try(const Eigen::VectorXd& weights, const Course& course);

  // The course and part with the most evidence so far.
  const std::optional<FoundCourse>& best() const { return best_; }

 private:
  double ProbabilityWithoutOne(const Eigen::VectorXd& weights,
                               const Course& course,
                               const ThetaPart& part,
                               double heterogeneity);

  const ConsistencyTester& tester_;
  const std::span<const OffsetInformation> segments_;
  const double level_;
  std::optional<Heterogeneity> heterogeneity_;  // computed when needed
  std::size_t suspect_ = 0;  // the segment whose exclusion last refuted a test
  std::optional<FoundCourse> best_;
};

}  // namespace selfcal
