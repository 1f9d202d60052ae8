#include "core/change/detect_change.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <span>

namespace selfcal {
namespace {

constexpr int kSmallestWindow = 2;

int CountWindows(int max_window) {
  int count = 0;
  for (int n = kSmallestWindow; n <= max_window; n *= 2) ++count;
  return count;
}

OffsetInformation Fuse(std::span<const OffsetInformation> segments) {
  OffsetInformation sum = segments.front();
  for (const OffsetInformation& segment : segments.subspan(1)) sum += segment;
  return sum;
}

// The test of a window with that segment left out that speaks loudest for a
// change: the largest probability.
double ProbabilityWithoutOne(const ConsistencyTester& tester,
                             std::span<const OffsetInformation> window,
                             const OffsetInformation& sum) {
  double largest = 0;
  for (const OffsetInformation& segment : window) {
    OffsetInformation rest = sum;
    rest -= segment;
    largest = std::max(largest, tester.Test(rest).probability);
  }
  return largest;
}

// ln of how much more probable the data is under an offset of which nothing is
// known but the prior, than under none.
double LogEvidence(const OffsetInformation& offset) {
  Eigen::MatrixXd posterior = offset.Lambda;
  posterior.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> llt(posterior);
  return offset.eta.dot(llt.solve(offset.eta)) / 2 -
         llt.matrixLLT().diagonal().array().log().sum();
}

// [n - 1]: the evidence for a step before the newest n segments.
std::vector<double> StepEvidence(std::span<const OffsetInformation> segments) {
  std::vector<double> evidence;
  OffsetInformation sum = segments.back();
  evidence.push_back(LogEvidence(sum));
  for (std::size_t n = 2; n <= segments.size(); ++n) {
    sum += segments[segments.size() - n];
    evidence.push_back(LogEvidence(sum));
  }
  return evidence;
}

// Of an offset that grows evenly over the newest n segments to what it is now.
double RampEvidence(std::span<const OffsetInformation> segments, int n) {
  const auto newest = segments.last(n);
  OffsetInformation sum = newest.back();
  for (int i = 0; i + 1 < n; ++i) {
    const double share = (i + 1.0) / n;
    sum.Lambda += share * share * newest[i].Lambda;
    sum.eta += share * newest[i].eta;
  }
  return LogEvidence(sum);
}

double Largest(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}

// The most segments that all come after the change with the probability, less
// the oldest of them: the change may lie within it.
int SegmentsSince(const std::vector<double>& evidence, double probability) {
  const double largest = Largest(evidence);
  double total = 0;
  for (const double e : evidence) total += std::exp(e - largest);
  double sum = 0;
  for (std::size_t n = evidence.size(); n > 1; --n) {
    sum += std::exp(evidence[n - 1] - largest) / total;
    if (sum >= probability) return static_cast<int>(n) - 1;
  }
  return 0;
}

ChangeKind Kind(std::span<const OffsetInformation> segments,
                const std::vector<double>& step) {
  double ramp = RampEvidence(segments, 2);
  for (int n = 3; n <= static_cast<int>(segments.size()); ++n) {
    ramp = std::max(ramp, RampEvidence(segments, n));
  }
  return ramp > Largest(step) ? ChangeKind::kDrift : ChangeKind::kSudden;
}

std::vector<std::string> Concerned(const std::vector<GroupConsistency>& groups,
                                   double level) {
  std::vector<std::string> names;
  for (const GroupConsistency& group : groups) {
    if (group.test.probability < level) names.push_back(group.group);
  }
  if (!names.empty()) return names;
  // None stands out: whichever it is, all are concerned.
  for (const GroupConsistency& group : groups) names.push_back(group.group);
  return names;
}

}  // namespace

std::optional<Change> DetectChange(const ConsistencyTester& tester,
                                   const std::vector<OffsetInformation>& newest,
                                   const ChangeOptions& options) {
  std::span<const OffsetInformation> segments(newest);
  segments = segments.last(
      std::min(segments.size(), static_cast<std::size_t>(options.max_window)));
  const int size = static_cast<int>(segments.size());
  const double level =
      options.false_alarm_rate / CountWindows(options.max_window);
  for (int n = kSmallestWindow; n <= size; n *= 2) {
    const auto window = segments.last(n);
    const OffsetInformation sum = Fuse(window);
    const ConsistencyTest test = tester.Test(sum);
    if (test.probability >= level ||
        ProbabilityWithoutOne(tester, window, sum) >= level) {
      continue;
    }
    Change change;
    change.window = n;
    change.test = test;
    const std::vector<double> step = StepEvidence(segments);
    change.kind = Kind(segments, step);
    change.segments_since = SegmentsSince(step, options.since_probability);
    const auto after = std::max_element(step.begin(), step.end());
    change.groups =
        tester.TestGroups(Fuse(segments.last(after - step.begin() + 1)));
    change.concerned = Concerned(change.groups, options.group_level);
    return change;
  }
  return std::nullopt;
}

}  // namespace selfcal
