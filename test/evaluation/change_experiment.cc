// Change of the device: false alarms of the test of a segment against the
// stated level. The alarms of segments in sequence, how many of them a shock or
// a drift takes to be found, what the calibration after it is, and what a real
// recording says, is in the files beside this one.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/change/detect_change.h"
#include "core/simulation/simulate.h"
#include "test/evaluation/change_device.h"
#include "test/evaluation/context.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr double kChangeLevel = 0.01;
constexpr double kByChance = 1e-3;

// What the device says of itself in use, without a change.
std::vector<SegmentInformation> UseUnchanged(const ChangeDevice& device,
                                             int index,
                                             int segments) {
  SimulationOptions options;
  options.seed = 2000 + index;
  const auto session =
      Simulate(device.rig,
               device.truth,
               device.active.theta,
               *MakeMixed(segments * kChangeSegment_s + 0.5, options.seed),
               "use",
               options);
  std::vector<SegmentInformation> all;
  for (const MotionSegment& segment : session.segments) {
    all.push_back(ScoreSegment(device.rig, device.active.theta, segment));
  }
  return all;
}

// The count that chance alone exceeds in less than one case of 1,000.
int LargestByChance(int trials, double rate) {
  int count = 0;
  while (BinomialTail(count + 1, trials, rate) >= kByChance) ++count;
  return count;
}

struct Counts {
  int tests = 0;
  int alarms = 0;
  double statistic = 0;
  double degrees = 0;

  void Add(const ConsistencyTest& test) {
    ++tests;
    alarms += test.probability < kChangeLevel;
    statistic += test.statistic;
    degrees += test.degrees;
  }
  Counts& operator+=(const Counts& other) {
    tests += other.tests;
    alarms += other.alarms;
    statistic += other.statistic;
    degrees += other.degrees;
    return *this;
  }
};

struct Unchanged {
  Counts all;
  std::vector<Counts> groups;
  int detected = 0;  // at the default rate
};

Unchanged TestUnchanged(const ChangeDevice& device,
                        const std::vector<SegmentInformation>& use) {
  const ConsistencyTester tester(device.rig, device.active);
  Unchanged counts;
  counts.groups.resize(device.rig.groups.size());
  std::vector<OffsetInformation> newest;
  for (const SegmentInformation& information : use) {
    if (!tester.Accepts(information)) continue;
    newest.push_back(tester.Offset(information));
    counts.all.Add(tester.Test(newest.back()));
    const auto groups = tester.TestGroups(newest.back());
    for (std::size_t q = 0; q < groups.size(); ++q) {
      counts.groups[q].Add(groups[q].test);
    }
    if (DetectChange(tester, newest)) {
      ++counts.detected;
      newest.clear();
    }
  }
  return counts;
}

void ReportSingle(const Rig& rig,
                  const std::vector<Unchanged>& devices,
                  Context* context) {
  Unchanged sum = devices.front();
  for (std::size_t i = 1; i < devices.size(); ++i) {
    sum.all += devices[i].all;
    sum.detected += devices[i].detected;
    for (std::size_t q = 0; q < sum.groups.size(); ++q) {
      sum.groups[q] += devices[i].groups[q];
    }
  }
  ResultTable table({"test",
                     "tests",
                     "statistic / degrees",
                     "alarms at 1 %",
                     "rate",
                     "probability of as many or more"});
  const auto add = [&](const std::string& name, const Counts& counts) {
    table.Add({name,
               static_cast<long>(counts.tests),
               counts.statistic / counts.degrees,
               static_cast<long>(counts.alarms),
               static_cast<double>(counts.alarms) / counts.tests,
               BinomialTail(counts.alarms, counts.tests, kChangeLevel)});
  };
  add("all", sum.all);
  for (std::size_t q = 0; q < sum.groups.size(); ++q) {
    add(rig.groups[q].name, sum.groups[q]);
  }
  context->WriteTable("single_segments", table);
  const double tests = sum.all.tests;
  context->AtMost("change.single_alarm_rate",
                  sum.all.alarms / tests,
                  LargestByChance(sum.all.tests, kChangeLevel) / tests,
                  {.robust = true});
  context->Within("change.statistic_over_degrees",
                  sum.all.statistic / sum.all.degrees,
                  1 - 3 * std::sqrt(2 / sum.all.degrees),
                  1 + 3 * std::sqrt(2 / sum.all.degrees));
  context->AtMost("change.false_detections",
                  sum.detected,
                  0,
                  {.unit = "at 1e-6", .robust = true});
}

}  // namespace

void RunChange(Context* context) {
  const int devices = context->quick() ? 1 : 60;
  const int segments = context->quick() ? 12 : 20;
  std::vector<ChangeDevice> all(devices);
  std::vector<Unchanged> unchanged(devices);
  std::vector<SegmentInformation> pool;
  context->ForEach(devices, [&](int i) {
    all[i] = MakeChangeDevice(i);
    const auto use = UseUnchanged(all[i], i, segments);
    unchanged[i] = TestUnchanged(all[i], use);
    if (i == 0) pool = use;
  });
  context->Progress("devices calibrated and tested without a change");
  ReportSingle(all.front().rig, unchanged, context);
  RunChangeRates(all.front(), pool, context);
  RunChangeDelays(all, context);
  RunChangeRecalibrations(all, context);
  RunChangeRecorded(context);
}

}  // namespace selfcal
