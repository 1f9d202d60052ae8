#include "core/change/split.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "core/change/course.h"
#include "core/change/course_search.h"

namespace selfcal {
namespace {

constexpr int kFewest = 2;  // segments on either side
// Less is worth looking at.
constexpr double kRare = 0.05;

// Growing with time from the segment before `first` to the last.
Eigen::VectorXd RampInTime(std::span<const std::int64_t> times, int first) {
  const auto count = static_cast<int>(times.size());
  const std::int64_t begin = times[first - 1];
  const auto whole = static_cast<double>(times.back() - begin);
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(count);
  for (int i = first; i < count; ++i) {
    weights(i) = static_cast<double>(times[i] - begin) / whole;
  }
  return weights;
}

}  // namespace

SplitTest TestSplit(const Rig& rig,
                    const Calibration& theta,
                    std::span<const SegmentInformation> segments,
                    std::span<const std::int64_t> times_ns,
                    double inflation) {
  const Eigen::VectorXd prior = PriorSigmas(rig);
  const ConsistencyTester tester(
      rig, {theta, Eigen::MatrixXd(prior.cwiseAbs2().asDiagonal())}, inflation);
  std::vector<OffsetInformation> tested;
  std::vector<std::int64_t> times;
  std::vector<int> index;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (!tester.Accepts(segments[i])) continue;
    tested.push_back(tester.Offset(segments[i]));
    times.push_back(times_ns[i]);
    index.push_back(static_cast<int>(i));
  }
  SplitTest result;
  const int count = static_cast<int>(tested.size());
  if (count < 2 * kFewest) return result;
  result.segments = count;
  const int splits = count - 2 * kFewest + 1;
  const double tests =
      2.0 * splits * static_cast<double>(tester.blocks().size());
  CourseSearch search(tester, tested, kRare / tests);
  const auto attempt = [&](const Eigen::VectorXd& weights) {
    search.Try(weights, MakeCourse(tested, weights, tester.root()));
  };
  for (int first = kFewest; first <= count - kFewest; ++first) {
    attempt(StepCourse(count, count - first));
    if (times.back() > times[first - 1]) attempt(RampInTime(times, first));
  }
  const std::optional<FoundCourse>& best = search.best();
  if (!best) return result;
  result.probability = std::min(1.0, tests * best->without_one);
  result.test = best->test;
  const bool step =
      (best->weights.array() == 0 || best->weights.array() == 1).all();
  result.kind = step ? ChangeKind::kSudden : ChangeKind::kDrift;
  const auto before = static_cast<int>((best->weights.array() == 0).count());
  result.first_after = index[before];
  result.block = best->block->name;
  return result;
}

}  // namespace selfcal
