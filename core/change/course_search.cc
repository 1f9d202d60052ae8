#include "core/change/course_search.h"

#include <algorithm>

#include "core/change/chi_square.h"
#include "core/change/group_concern.h"

namespace selfcal {
namespace {

ConsistencyTest Noisier(ConsistencyTest test, double heterogeneity) {
  test.statistic /= heterogeneity;
  test.probability = ChiSquareTail(test.statistic, test.degrees);
  return test;
}

}  // namespace

// Stops at the first segment whose exclusion reaches the level: usually the
// same segment is decisive for many tests.
double CourseSearch::ProbabilityWithoutOne(const Eigen::VectorXd& weights,
                                           const Course& course,
                                           const ThetaPart& part,
                                           double heterogeneity) {
  double largest = 0;
  for (std::size_t k = 0; k < segments_.size(); ++k) {
    const std::size_t i = (suspect_ + k) % segments_.size();
    Course rest = course;
    rest.Remove(segments_[i], weights(static_cast<Eigen::Index>(i)));
    const ConsistencyTest test = TestSpan(rest.Change(), part.basis);
    const double probability =
        test.degrees == 0 ? 1 : Noisier(test, heterogeneity).probability;
    largest = std::max(largest, probability);
    if (largest >= level_ * part.share) {
      suspect_ = i;
      break;
    }
  }
  return largest;
}

void CourseSearch::Try(const Eigen::VectorXd& weights, const Course& course) {
  const OffsetInformation change = course.Change();
  for (const ThetaPart& part : tester_.parts()) {
    const double level = level_ * part.share;
    const ConsistencyTest plain = TestSpan(change, part.basis);
    if (plain.degrees == 0 || plain.probability >= level) continue;
    if (!heterogeneity_) heterogeneity_.emplace(segments_);
    const double heterogeneity =
        heterogeneity_->Of(weights, course, part.basis);
    const ConsistencyTest test = Noisier(plain, heterogeneity);
    const double evidence = LogEvidence(change, part.basis) / heterogeneity;
    if (test.probability >= level || (best_ && evidence <= best_->evidence)) {
      continue;
    }
    const double without_one =
        ProbabilityWithoutOne(weights, course, part, heterogeneity);
    if (without_one >= level) continue;
    best_ = {weights, &part, test, without_one, heterogeneity, evidence};
  }
}

}  // namespace selfcal
