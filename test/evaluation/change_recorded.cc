// The test for a change on a real recording: calibrated on one half, tested on
// the other. The device did not change; then as if the active calibration's
// camera were turned.
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/change/detect_change.h"
#include "test/evaluation/change_device.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/recordings.h"

namespace selfcal {
namespace {

constexpr double kRecordedLevel = 0.01;

struct Half {
  std::string name;
  KnownCalibration active;
  std::vector<MotionSegment> others;
};

Half CalibrateHalf(const RecordedDevice& device, bool first) {
  const auto middle =
      device.segments.begin() + static_cast<long>(device.segments.size() / 2);
  std::vector<MotionSegment> one(device.segments.begin(), middle);
  std::vector<MotionSegment> other(middle, device.segments.end());
  if (!first) one.swap(other);
  const CalibrationResult result =
      Calibrate(device.rig, device.rig.factory, one, ComparedOptions());
  if (result.status != CalibrateStatus::kConverged) {
    throw std::runtime_error("half of a recording: " + result.message);
  }
  return {first ? "first half" : "second half",
          {result.theta, result.covariance, result.track_noise_factor},
          other};
}

struct Tested {
  int segments = 0;
  int rare = 0;
  int detections = 0;
  int delay = 0;  // of the first detection
  double statistic = 0;
  double degrees = 0;
};

Tested TestOthers(const Rig& rig,
                  const Half& half,
                  const DeviceChange& change,
                  std::optional<double> inflation) {
  KnownCalibration active = half.active;
  active.theta = change.After(active.theta, 1);
  const ConsistencyTester tester(rig, active, inflation);
  Tested tested;
  std::vector<OffsetInformation> newest;
  for (const MotionSegment& segment : half.others) {
    const auto information = ScoreSegment(rig, active.theta, segment);
    if (!tester.Accepts(information)) continue;
    ++tested.segments;
    newest.push_back(tester.Offset(information));
    const ConsistencyTest test = tester.Test(newest.back());
    tested.rare += test.probability < kRecordedLevel;
    tested.statistic += test.statistic;
    tested.degrees += test.degrees;
    if (DetectChange(tester, newest)) {
      ++tested.detections;
      if (tested.delay == 0) tested.delay = tested.segments;
      newest.clear();
    }
  }
  return tested;
}

void Add(const Half& half,
         const DeviceChange& change,
         double inflation,
         const Tested& tested,
         ResultTable* table) {
  table->Add(
      {half.name,
       change.name,
       half.active.track_noise_factor,
       inflation,
       static_cast<long>(tested.segments),
       tested.statistic / tested.degrees,
       static_cast<long>(tested.rare),
       static_cast<long>(tested.detections),
       tested.delay > 0 ? Cell(static_cast<long>(tested.delay)) : Cell()});
}

}  // namespace

void RunChangeRecorded(Context* context) {
  const std::optional<RecordedDevice> tango = ReadTango();
  if (!tango) return;
  const DeviceChange none{"none", ""};
  const std::vector<DeviceChange> turns = {
      {"turn 0.5 deg", "extrinsics", false, 0.5, 0},
      {"turn 1 deg", "extrinsics", false, 1, 0}};
  std::vector<Half> halves(context->quick() ? 1 : 2);
  context->ForEach(static_cast<int>(halves.size()),
                   [&](int i) { halves[i] = CalibrateHalf(*tango, i == 0); });
  ResultTable table({"calibrated on",
                     "change",
                     "track noise factor",
                     "inflation of segments",
                     "segments tested",
                     "statistic / degrees",
                     "alarms at 1 %",
                     "changes detected",
                     "first after [segments]"});
  Tested sum;
  for (const Half& half : halves) {
    const double inflation =
        ConsistencyTester(tango->rig, half.active).inflation();
    const Tested tested = TestOthers(tango->rig, half, none, {});
    sum.statistic += tested.statistic;
    sum.degrees += tested.degrees;
    sum.detections += tested.detections;
    Add(half, none, inflation, tested, &table);
    Add(half, none, 1, TestOthers(tango->rig, half, none, 1), &table);
    for (const DeviceChange& turn : turns) {
      Add(half,
          turn,
          inflation,
          TestOthers(tango->rig, half, turn, {}),
          &table);
    }
  }
  context->WriteTable("recorded", table);
  context->AtMost("change.recorded_false_detections", sum.detections, 0);
  // Disjoint sets may differ by 1.3 joint sigmas.
  context->AtMost("change.recorded_statistic_over_degrees",
                  sum.statistic / sum.degrees,
                  1.3 * 1.3);
  context->Progress("a real recording");
}

}  // namespace selfcal
