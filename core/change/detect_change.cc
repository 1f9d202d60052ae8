#include "core/change/detect_change.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "core/change/course.h"
#include "core/change/course_search.h"

namespace selfcal {
namespace {

constexpr int kShortestStep = 2;
constexpr int kShortestRamp = 8;

// The size of the next longer step to test.
int NextLonger(int n) { return n + std::max(1, n / 4); }

int CountCourses(int max_window) {
  int count = 0;
  for (int n = kShortestStep; n <= max_window; n = NextLonger(n)) ++count;
  for (int n = kShortestRamp; n <= max_window; n *= 2) ++count;
  return count;
}

void TryAll(const ConsistencyTester& tester,
            std::span<const OffsetInformation> segments,
            CourseSearch* search) {
  const int count = static_cast<int>(segments.size());
  Course step = MakeCourse(segments, StepCourse(count, 0), tester.root());
  int after = 0;
  for (int n = kShortestStep; n <= count; n = NextLonger(n)) {
    for (; after < n; ++after) {
      const OffsetInformation& segment = segments[count - 1 - after];
      step.Remove(segment, 0);
      step.Add(segment, 1);
    }
    search->Try(StepCourse(count, n), step);
  }
  for (int n = kShortestRamp; n <= count; n *= 2) {
    const Eigen::VectorXd weights = RampCourse(count, n);
    search->Try(weights, MakeCourse(segments, weights, tester.root()));
  }
}

// Evidence for every course of one kind over the newest segments.
struct Evidence {
  std::vector<double> step;  // [n - 1]: before the newest n
  std::vector<double> ramp;  // [n - 2]: over the newest n
};

Evidence EvidenceOfAll(const ConsistencyTester& tester,
                       std::span<const OffsetInformation> segments,
                       const FoundCourse& found) {
  const int count = static_cast<int>(segments.size());
  const auto of = [&](const Eigen::VectorXd& weights) {
    const Course course = MakeCourse(segments, weights, tester.root());
    return LogEvidence(course.Change(), found.part->basis) /
           found.heterogeneity;
  };
  Evidence evidence;
  for (int n = 1; n <= count; ++n) {
    evidence.step.push_back(of(StepCourse(count, n)));
    if (n > 1) evidence.ramp.push_back(of(RampCourse(count, n)));
  }
  return evidence;
}

std::size_t Largest(const std::vector<double>& values) {
  return std::max_element(values.begin(), values.end()) - values.begin();
}

// Number of segments that are all after the change with the given probability,
// at most, minus the oldest of them: the change may lie within it.
int SegmentsSince(const std::vector<double>& evidence, double probability) {
  const double largest = evidence[Largest(evidence)];
  double total = 0;
  for (const double e : evidence) total += std::exp(e - largest);
  double sum = 0;
  for (std::size_t n = evidence.size(); n > 1; --n) {
    sum += std::exp(evidence[n - 1] - largest) / total;
    if (sum >= probability) return static_cast<int>(n) - 1;
  }
  return 0;
}

Change Describe(const ConsistencyTester& tester,
                std::span<const OffsetInformation> segments,
                const FoundCourse& found,
                const ChangeOptions& options) {
  Change change;
  change.window = static_cast<int>((found.weights.array() > 0).count());
  change.block = found.part->name;
  change.test = found.test;
  const Evidence evidence = EvidenceOfAll(tester, segments, found);
  const std::size_t step = Largest(evidence.step);
  const std::size_t ramp = Largest(evidence.ramp);
  const bool drifts = evidence.ramp[ramp] > evidence.step[step];
  change.kind = drifts ? ChangeKind::kDrift : ChangeKind::kSudden;
  change.segments_since =
      SegmentsSince(evidence.step, options.since_probability);
  const int count = static_cast<int>(segments.size());
  const Course course =
      MakeCourse(segments,
                 drifts ? RampCourse(count, static_cast<int>(ramp) + 2)
                        : StepCourse(count, static_cast<int>(step) + 1),
                 tester.root());
  OffsetInformation information = course.Change();
  information.Lambda /= found.heterogeneity;
  information.eta /= found.heterogeneity;
  change.groups =
      FindConcerned(tester.groups(), information, options.group_level);
  change.concerned = ConcernedNames(change.groups);
  return change;
}

}  // namespace

std::optional<Change> DetectChange(const ConsistencyTester& tester,
                                   const std::vector<OffsetInformation>& newest,
                                   const ChangeOptions& options) {
  const std::span<const OffsetInformation> segments = std::span(newest).last(
      std::min(newest.size(), static_cast<std::size_t>(options.max_window)));
  const auto courses = static_cast<double>(CountCourses(options.max_window));
  CourseSearch search(tester, segments, options.false_alarm_rate / courses);
  TryAll(tester, segments, &search);
  if (!search.best()) return std::nullopt;
  return Describe(tester, segments, *search.best(), options);
}

}  // namespace selfcal
