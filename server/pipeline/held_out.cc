#include "server/pipeline/held_out.h"

#include <algorithm>

namespace selfcal::server {
namespace {

OffsetInformation Fuse(const ConsistencyTester& tester,
                       const std::vector<const HeldOutSegment*>& segments) {
  OffsetInformation sum = tester.Offset(segments.front()->information);
  for (std::size_t k = 1; k < segments.size(); ++k) {
    sum += tester.Offset(segments[k]->information);
  }
  return sum;
}

// The segment to leave out. Call with more than two.
std::size_t LeastFitting(const ConsistencyTester& tester,
                         const std::vector<const HeldOutSegment*>& segments) {
  const OffsetInformation sum = Fuse(tester, segments);
  std::size_t least = 0;
  double best = -1;
  for (std::size_t k = 0; k < segments.size(); ++k) {
    OffsetInformation rest = sum;
    rest -= tester.Offset(segments[k]->information);
    const double probability = tester.Test(rest).probability;
    if (probability > best) {
      best = probability;
      least = k;
    }
  }
  return least;
}

}  // namespace

HeldOutTest TestHeldOut(const Rig& rig,
                        const KnownCalibration& candidate,
                        const KnownCalibration& active,
                        const HeldOutSegments& segments) {
  const ConsistencyTester tester(rig, candidate);
  const ConsistencyTester before(rig, active, tester.inflation());
  std::vector<const HeldOutSegment*> tested;
  for (const HeldOutSegment& segment : segments) {
    if (tester.Accepts(segment.information)) {
      tested.push_back(&segment);
    }
  }
  if (tested.size() > 2) {
    const auto least =
        static_cast<std::ptrdiff_t>(LeastFitting(tester, tested));
    tested.erase(tested.begin() + least);
  }
  HeldOutTest test;
  test.segments = static_cast<int>(tested.size());
  test.left_out = static_cast<int>(segments.size() - tested.size());
  test.rescored = static_cast<int>(
      std::count_if(tested.begin(), tested.end(), [](const auto* segment) {
        return segment->rescored;
      }));
  if (!tested.empty()) {
    test.candidate = tester.Test(Fuse(tester, tested));
    test.active = before.Test(Fuse(before, tested));
  }
  return test;
}

}  // namespace selfcal::server
