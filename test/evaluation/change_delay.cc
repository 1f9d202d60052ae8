// How many segments a shock or a drift takes to be found.
#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "core/change/detect_change.h"
#include "test/evaluation/change_device.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr int kDelayBefore = 8;  // segments before the change
constexpr int kLongest = 64;
constexpr int kPlotted = 32;

struct DelayScenario {
  DeviceChange change;
  std::string figure;  // change.delay_<figure>
};

const std::vector<DelayScenario>& Scenarios() {
  static const std::vector<DelayScenario> scenarios = {
      {{"turn 0.2 deg", "extrinsics", false, 0.2, 0}, "turn_0.2_deg"},
      {{"turn 0.5 deg", "extrinsics", false, 0.5, 0}, "turn_0.5_deg"},
      {{"turn 1 deg", "extrinsics", false, 1, 0}, "turn_1_deg"},
      {{"focal 0.5 %", "camera", false, 0, 0.005}, "focal_0.5_percent"},
      {{"drift 0.01 deg a segment", "extrinsics", true, 0.01, 0},
       "drift_turn_0.01_deg_a_segment"},
      {{"drift focal 0.02 % a segment", "camera", true, 0, 0.0002},
       "drift_focal_0.02_percent_a_segment"}};
  return scenarios;
}

struct Detection {
  std::optional<int> delay;  // segments after the change
  bool false_alarm = false;
  bool too_early = false;  // a segment from before counts as after
  bool group = false;      // among those concerned
  bool group_alone = false;
  bool drift = false;
};

Detection Detect(const ChangeDevice& device,
                 const DeviceChange& scenario,
                 std::uint64_t seed) {
  const ConsistencyTester tester(device.rig, device.active);
  const ChangeUse use(device, kDelayBefore + kLongest, seed);
  Detection detection;
  std::vector<OffsetInformation> newest;
  for (int i = 0; i < kDelayBefore + kLongest; ++i) {
    const int after = i - kDelayBefore + 1;
    const Calibration truth =
        after > 0 ? scenario.After(device.truth, after) : device.truth;
    const auto information =
        ScoreSegment(device.rig, device.active.theta, use.Segment(i, truth));
    if (!tester.Accepts(information)) continue;
    newest.push_back(tester.Offset(information));
    const auto change = DetectChange(tester, newest);
    if (!change) continue;
    if (after <= 0) {
      detection.false_alarm = true;
      newest.clear();
      continue;
    }
    const auto& concerned = change->concerned;
    detection.delay = after;
    detection.too_early = change->segments_since > after;
    detection.group =
        std::count(concerned.begin(), concerned.end(), scenario.group) > 0;
    detection.group_alone = detection.group && concerned.size() == 1;
    detection.drift = change->kind == ChangeKind::kDrift;
    break;
  }
  return detection;
}

double Share(const std::vector<Detection>& detections,
             bool (*is)(const Detection&)) {
  return static_cast<double>(
             std::count_if(detections.begin(), detections.end(), is)) /
         static_cast<double>(detections.size());
}

double Missed(const std::vector<Detection>& detections) {
  return Share(detections, [](const Detection& d) { return !d.delay; });
}

std::vector<double> Delays(const std::vector<Detection>& detections) {
  std::vector<double> delays;
  for (const Detection& detection : detections) {
    if (detection.delay) delays.push_back(*detection.delay);
  }
  return delays;
}

void WriteDelays(const std::vector<std::vector<Detection>>& all,
                 Context* context) {
  ResultTable table({"change",
                     "runs",
                     "missed",
                     "false alarms before it",
                     "delay, mean [segments]",
                     "delay, median",
                     "delay, largest",
                     "right group concerned",
                     "right group alone",
                     "told as drift",
                     "a segment from before counted as after"});
  for (std::size_t s = 0; s < all.size(); ++s) {
    const std::vector<double> delays = Delays(all[s]);
    const auto share = [&](bool (*is)(const Detection&)) {
      return Share(all[s], is);
    };
    std::vector<Cell> row = {Scenarios()[s].change.name,
                             static_cast<long>(all[s].size()),
                             Missed(all[s]),
                             share([](auto& d) { return d.false_alarm; }),
                             {},
                             {},
                             {},
                             share([](auto& d) { return d.group; }),
                             share([](auto& d) { return d.group_alone; }),
                             share([](auto& d) { return d.drift; }),
                             share([](auto& d) { return d.too_early; })};
    if (!delays.empty()) {
      row[4] = Mean(delays);
      row[5] = MedianOf(delays);
      row[6] = Quantile(delays, 1);
    }
    table.Add(row);
  }
  context->WriteTable("delays", table);
}

void PlotDelays(const std::vector<std::vector<Detection>>& all,
                Context* context) {
  Plot plot{.title = "Segments until a change is found",
            .x_label = "segments after the change",
            .y_label = "share of runs found by then"};
  for (std::size_t s = 0; s < all.size(); ++s) {
    const std::vector<double> delays = Delays(all[s]);
    Series series{.label = Scenarios()[s].change.name,
                  .style = SeriesStyle::kSteps,
                  .dashed = Scenarios()[s].change.drift};
    for (int n = 0; n <= kPlotted; ++n) {
      const auto found = std::count_if(
          delays.begin(), delays.end(), [&](double d) { return d <= n; });
      series.x.push_back(n);
      series.y.push_back(static_cast<double>(found) /
                         static_cast<double>(all[s].size()));
    }
    plot.series.push_back(series);
  }
  context->WritePlot("delays", plot);
}

// A shock is to be found before half of a table is spoilt; a drift as soon as
// the longest window holds nothing else, and half as long again.
void CheckDelays(const std::vector<std::vector<Detection>>& all,
                 Context* context) {
  std::vector<Detection> every;
  for (std::size_t s = 0; s < all.size(); ++s) {
    every.insert(every.end(), all[s].begin(), all[s].end());
    const std::vector<double> delays = Delays(all[s]);
    if (delays.empty()) continue;  // missed, which is a figure
    context->AtMost("change.delay_" + Scenarios()[s].figure,
                    Mean(delays),
                    Scenarios()[s].change.drift ? 24 : 4,
                    {.unit = "segments"});
  }
  context->AtMost("change.missed", Missed(every), 0, {.robust = true});
  context->AtLeast("change.right_group_concerned",
                   Share(every, [](auto& d) { return d.group; }),
                   0.95);
  context->AtLeast("change.right_group_alone",
                   Share(every, [](auto& d) { return d.group_alone; }),
                   0.8);
  context->AtMost("change.segment_from_before_counted_as_after",
                  Share(every, [](auto& d) { return d.too_early; }),
                  0.01);
}

}  // namespace

void RunChangeDelays(const std::vector<ChangeDevice>& devices,
                     Context* context) {
  const int runs = context->quick() ? 1 : 20;
  const int count = static_cast<int>(Scenarios().size());
  std::vector<std::vector<Detection>> all(count, std::vector<Detection>(runs));
  context->ForEach(count * runs, [&](int i) {
    const int run = i % runs;
    all[i / runs][run] = Detect(devices[run % devices.size()],
                                Scenarios()[i / runs].change,
                                3000 + run);
  });
  WriteDelays(all, context);
  PlotDelays(all, context);
  CheckDelays(all, context);
  context->Progress("shocks and drifts");
}

}  // namespace selfcal
