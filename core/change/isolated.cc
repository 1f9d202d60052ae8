#include "core/change/isolated.h"

#include <algorithm>
#include <cstddef>

#include "core/change/chi_square.h"
#include "core/change/course.h"

namespace selfcal {
namespace {

// False-alarm probability, for two neighbours.
constexpr double kChance = 1e-6;
// A single pair does not determine the typical difference.
constexpr std::size_t kFewest = 4;

// Tests whether two neighbours have the same theta, of which only the prior is
// known.
ConsistencyTest TestPair(std::span<const OffsetInformation> pair) {
  const Eigen::Index size = pair.front().eta.size();
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(size, size);
  return TestSpan(MakeCourse(pair, StepCourse(2, 1), one).Change(), one);
}

// A quarter of all pairs differ by less: if one segment in five is isolated,
// two pairs in five are not typical. At least 1.
double UsualPerDegree(const std::vector<ConsistencyTest>& pairs) {
  std::vector<double> per_degree;
  for (const ConsistencyTest& pair : pairs) {
    if (pair.degrees > 0) per_degree.push_back(pair.statistic / pair.degrees);
  }
  if (per_degree.empty()) return 1;
  const auto quarter =
      per_degree.begin() + static_cast<std::ptrdiff_t>(per_degree.size() / 4);
  std::nth_element(per_degree.begin(), quarter, per_degree.end());
  return std::max(1.0, *quarter);
}

}  // namespace

std::vector<int> FindIsolated(std::span<const OffsetInformation> segments) {
  std::vector<int> isolated;
  if (segments.size() < kFewest) return isolated;
  std::vector<ConsistencyTest> pairs;
  for (std::size_t i = 1; i < segments.size(); ++i) {
    pairs.push_back(TestPair(segments.subspan(i - 1, 2)));
  }
  const double usual = UsualPerDegree(pairs);
  const auto contradict = [&](std::size_t pair) {
    const ConsistencyTest& test = pairs[pair];
    return test.degrees > 0 &&
           ChiSquareTail(test.statistic / usual, test.degrees) < kChance;
  };
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const bool first = i == 0;
    const bool last = i == pairs.size();
    if ((first || contradict(i - 1)) && (last || contradict(i))) {
      isolated.push_back(static_cast<int>(i));
    }
  }
  return isolated;
}

}  // namespace selfcal
