// A camera turned by 0.2 degrees between two sessions of calm motion: after how
// many segments it is found, how many the test of a known turn would take, and
// whether a set of segments from before and after it is found out.
#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/calibration/memory_split.h"
#include "core/calibration/subspace.h"
#include "core/change/course.h"
#include "core/change/detect_change.h"
#include "core/simulation/simulate.h"
#include "test/evaluation/change_device.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr int kTurnFirstDevice = 41000;  // seeds of their own
constexpr int kActive = 16;              // segments of the session before
constexpr int kTurnBefore = 10;          // segments of the next before the turn
constexpr int kAfter = 24;
constexpr double kSure = 1e-4;  // of a split, as a run takes it for a change

const DeviceChange kTurn{"turn 0.2 deg", "extrinsics", false, 0.2, 0};

struct TurnOutcome {
  std::optional<int> delay;         // of the test of single segments
  std::optional<int> joined_delay;  // of that of segments joined at their ends
  bool false_alarm = false;
  bool group = false;
  // Noncentrality of the turn in ten segments: the square of the sigmas by
  // which a test of this turn alone sees it.
  double shown = 0;
  double mixed = 1;    // probability of the set from before and after
  double unmixed = 1;  // of as large a set from after it
};

// What the segments of a session show, by themselves and joined.
struct ScoredSession {
  std::vector<SegmentInformation> segments;
  std::vector<SegmentEnds> ends;
};

ScoredSession ScoreSession(const ChangeDevice& device,
                           const Calibration& truth,
                           double excitation,
                           int segments,
                           const std::string& name,
                           std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.revisit_fraction = 0;
  const auto session = Simulate(
      device.rig,
      truth,
      device.active.theta,
      *MakeHandheld(segments * kChangeSegment_s + 0.5, excitation, seed),
      name,
      options);
  ScoredSession scored;
  for (const MotionSegment& segment : session.segments) {
    scored.segments.push_back(
        ScoreSegment(device.rig, device.active.theta, segment));
    scored.ends.push_back(
        SummariseEnds(device.rig, device.active.theta, segment));
  }
  return scored;
}

double Shown(const ConsistencyTester& tester,
             const ChangeDevice& device,
             const std::vector<SegmentInformation>& after) {
  Course course(tester.root());
  for (int i = 0; i < 10; ++i) course.Add(tester.Offset(after[i]), 1);
  const std::vector<int> free = FreeComponents(device.rig);
  const Eigen::VectorXd turn =
      BoxMinus(kTurn.After(device.truth, 1), device.truth)(free).cwiseQuotient(
          PriorSigmas(device.rig)(free));
  return turn.dot(course.Change().Lambda * turn);
}

double SplitProbability(const ChangeDevice& device,
                        std::span<const SegmentEnds> before,
                        std::span<const SegmentEnds> after) {
  std::vector<JoinedSegment> joined;
  for (const SegmentEnds& ends : before) joined.push_back({.ends = &ends});
  for (const SegmentEnds& ends : after) joined.push_back({.ends = &ends});
  return FindSplit(device.rig,
                   device.active.theta,
                   WholeSubspace(device.rig).estimated,
                   1,
                   joined,
                   {})
      .split.without_one;
}

TurnOutcome Run(int index, double excitation) {
  const ChangeDevice device = MakeChangeDevice(
      index,
      *MakeHandheld(kActive * kChangeSegment_s + 0.5, excitation, index));
  const auto before = ScoreSession(
      device, device.truth, excitation, kTurnBefore, "before", 100'000 + index);
  const auto after = ScoreSession(device,
                                  kTurn.After(device.truth, 1),
                                  excitation,
                                  kAfter,
                                  "after",
                                  200'000 + index);
  const ConsistencyTester tester(device.rig, device.active);
  TurnOutcome outcome;
  outcome.shown = Shown(tester, device, after.segments);
  std::vector<OffsetInformation> newest;
  for (const SegmentInformation& information : before.segments) {
    newest.push_back(tester.Offset(information));
    outcome.false_alarm |= DetectChange(tester, newest).has_value();
  }
  for (int i = 0; i < kAfter && !outcome.delay; ++i) {
    newest.push_back(tester.Offset(after.segments[i]));
    const auto change = DetectChange(tester, newest);
    if (!change) continue;
    outcome.delay = i + 1;
    outcome.group = std::count(change->concerned.begin(),
                               change->concerned.end(),
                               kTurn.group) > 0;
  }
  const std::span<const SegmentEnds> ends(after.ends);
  for (int i = 2; i <= kAfter && !outcome.joined_delay; ++i) {
    const double probability =
        SplitProbability(device, before.ends, ends.first(i));
    if (probability < kSure) outcome.joined_delay = i;
  }
  outcome.mixed =
      SplitProbability(device, before.ends, ends.first(kTurnBefore));
  outcome.unmixed = SplitProbability(
      device, ends.first(kTurnBefore), ends.subspan(kTurnBefore, kTurnBefore));
  return outcome;
}

double Share(const std::vector<TurnOutcome>& outcomes,
             bool (*is)(const TurnOutcome&)) {
  return static_cast<double>(
             std::count_if(outcomes.begin(), outcomes.end(), is)) /
         static_cast<double>(outcomes.size());
}

}  // namespace

void RunTurnCalm(Context* context) {
  const std::vector<double> excitations = {0.1, 0.2, 0.3};
  const int devices = context->quick() ? 1 : 8;
  const auto count = static_cast<int>(excitations.size());
  std::vector<std::vector<TurnOutcome>> all(count,
                                            std::vector<TurnOutcome>(devices));
  context->ForEach(count * devices, [&](int i) {
    all[i / devices][i % devices] =
        Run(kTurnFirstDevice + i, excitations[i / devices]);
  });
  ResultTable table({"excitation",
                     "devices",
                     "turn in ten segments [sigma of a test of it alone]",
                     "found within 10",
                     "found within 24",
                     "delay, median",
                     "joined: found within 10",
                     "joined: delay, median",
                     "right group concerned",
                     "false alarms before it",
                     "mixed sets found (1 %)",
                     "unmixed sets found (1 %)"});
  for (int e = 0; e < count; ++e) {
    std::vector<double> delays, joined_delays, shown;
    for (const TurnOutcome& outcome : all[e]) {
      delays.push_back(outcome.delay.value_or(kAfter + 1));
      joined_delays.push_back(outcome.joined_delay.value_or(kAfter + 1));
      shown.push_back(std::sqrt(outcome.shown));
    }
    const auto share = [&](bool (*is)(const TurnOutcome&)) {
      return Share(all[e], is);
    };
    table.Add(
        {excitations[e],
         static_cast<long>(devices),
         Mean(shown),
         share([](auto& o) { return o.delay && *o.delay <= 10; }),
         share([](auto& o) { return o.delay.has_value(); }),
         MedianOf(delays),
         share([](auto& o) { return o.joined_delay && *o.joined_delay <= 10; }),
         MedianOf(joined_delays),
         share([](auto& o) { return o.group; }),
         share([](auto& o) { return o.false_alarm; }),
         share([](auto& o) { return o.mixed < 0.01; }),
         share([](auto& o) { return o.unmixed < 0.01; })});
    if (e == 0) continue;  // too little is shown there for any test
    const std::string at = "_at_excitation_0." + std::to_string(e + 1);
    context->AtMost("turn_calm.median_delay" + at,
                    MedianOf(delays),
                    10,
                    {.unit = "segments"});
    context->AtLeast("turn_calm.mixed_sets_found" + at,
                     share([](auto& o) { return o.mixed < 0.01; }),
                     0.75);
  }
  context->WriteTable("turn_calm", table);
}

}  // namespace selfcal
