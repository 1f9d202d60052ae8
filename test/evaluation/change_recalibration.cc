// After a shock: the calibration on the segments since, as the daemon makes it,
// and that on tables that were not restarted.
#include <cmath>
#include <numbers>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/change/concerned.h"
#include "core/change/detect_change.h"
#include "core/change/group_concern.h"
#include "test/evaluation/change_device.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr int kRecalibrationBefore = 8;  // segments before the shock
constexpr int kAfter = 8;                // that a run is on
constexpr int kMost = 32;                // segments of a device

const DeviceChange kShock{"turn 0.5 deg", "extrinsics", false, 0.5, 0};

// What a device sent until a run on segments after the change was possible.
struct Sent {
  std::vector<MotionSegment> segments;
  std::vector<SegmentInformation> information;
  int first_after = 0;  // as it was detected
  std::vector<std::string> concerned;
};

Sent UseUntilRun(const ChangeDevice& device, std::uint64_t seed) {
  const ConsistencyTester tester(device.rig, device.active);
  const ChangeUse use(device, kMost, seed);
  const Calibration after = kShock.After(device.truth, 1);
  Sent sent;
  std::vector<OffsetInformation> newest;
  for (int i = 0; i < kMost; ++i) {
    sent.segments.push_back(
        use.Segment(i, i < kRecalibrationBefore ? device.truth : after));
    sent.information.push_back(
        ScoreSegment(device.rig, device.active.theta, sent.segments.back()));
    if (sent.concerned.empty()) {
      newest.push_back(tester.Offset(sent.information.back()));
      if (const auto change = DetectChange(tester, newest)) {
        sent.first_after = i + 1 - change->segments_since;
        sent.concerned = change->concerned;
      }
    }
    if (!sent.concerned.empty() && i + 1 - sent.first_after >= kAfter) {
      return sent;
    }
  }
  throw std::runtime_error("a shock was not detected");
}

// Of the segments from `first` on, those that the tables keep.
std::vector<MotionSegment> Kept(const Rig& rig, const Sent& sent, int first) {
  const std::vector<MotionSegment> segments(sent.segments.begin() + first,
                                            sent.segments.end());
  return Pick(
      segments,
      MostInformative(
          rig, {sent.information.begin() + first, sent.information.end()}));
}

// What stays known of the groups that are not concerned, as far as the segments
// since do not show otherwise.
ThetaPrior KnownAfter(const ChangeDevice& device, const Sent& sent) {
  const Eigen::MatrixXd doubt =
      DoubtOfUnconcerned(device.rig,
                         device.active,
                         std::span(sent.information).subspan(sent.first_after),
                         sent.concerned);
  return MarginalPrior(device.rig,
                       device.active.theta,
                       device.active.covariance + doubt,
                       UnconcernedComponents(device.rig, sent.concerned));
}

struct RecalibrationOutcome {
  double segments = 0;
  double from_before = 0;
  double turn_error_deg = 0;  // of the camera
  double nees = 0;            // of all that is estimated, by its dimension
};

RecalibrationOutcome CalibrateAfter(const ChangeDevice& device,
                                    const std::vector<MotionSegment>& segments,
                                    const CalibrateOptions& options) {
  const CalibrationResult result =
      Calibrate(device.rig, device.active.theta, segments, options);
  if (result.status != CalibrateStatus::kConverged) {
    throw std::runtime_error("a calibration after a shock: " + result.message);
  }
  const Calibration truth = kShock.After(device.truth, 1);
  RecalibrationOutcome outcome;
  outcome.segments = static_cast<double>(segments.size());
  for (const MotionSegment& segment : segments) {
    // Sessions are named by the order of their segments.
    outcome.from_before +=
        std::stoi(segment.key.session.substr(std::string("use-").size())) <
        kRecalibrationBefore;
  }
  outcome.turn_error_deg =
      result.theta.cameras[0].q_CI.angularDistance(truth.cameras[0].q_CI) *
      180 / std::numbers::pi;
  const auto [nees, dof] =
      NormalisedSquaredError(BoxMinus(result.theta, truth), result.covariance);
  outcome.nees = nees / dof;
  return outcome;
}

struct RecalibrationSummary {
  double segments = 0, from_before = 0, turn_error_deg = 0, nees = 0;
};

RecalibrationSummary Add(const std::string& name,
                         const std::vector<RecalibrationOutcome>& outcomes,
                         ResultTable* table) {
  const auto of = [&](double RecalibrationOutcome::*value) {
    std::vector<double> values;
    for (const RecalibrationOutcome& outcome : outcomes)
      values.push_back(outcome.*value);
    return values;
  };
  const RecalibrationSummary summary{
      Mean(of(&RecalibrationOutcome::segments)),
      Mean(of(&RecalibrationOutcome::from_before)),
      Rms(of(&RecalibrationOutcome::turn_error_deg)),
      Mean(of(&RecalibrationOutcome::nees))};
  table->Add({name,
              static_cast<long>(outcomes.size()),
              summary.segments,
              summary.from_before,
              summary.turn_error_deg,
              summary.nees});
  return summary;
}

}  // namespace

void RunChangeRecalibrations(const std::vector<ChangeDevice>& devices,
                             Context* context) {
  const int runs = context->quick() ? 1 : 20;
  std::vector<RecalibrationOutcome> since(runs), mixed(runs);
  context->ForEach(runs, [&](int i) {
    const ChangeDevice& device = devices[i % devices.size()];
    const Sent sent = UseUntilRun(device, 5000 + i);
    since[i] = CalibrateAfter(device,
                              Kept(device.rig, sent, sent.first_after),
                              {.prior = KnownAfter(device, sent)});
    // All of them: a calibration by itself would leave out the minority.
    mixed[i] = CalibrateAfter(
        device, Kept(device.rig, sent, 0), {.exclude_contradictions = false});
  });
  ResultTable table({"calibration after a turn of 0.5 deg",
                     "runs",
                     "segments, mean",
                     "of these from before",
                     "rotation error, rms [deg]",
                     "NEES / dimension"});
  const RecalibrationSummary after = Add("tables restarted", since, &table);
  const RecalibrationSummary without =
      Add("tables as they were", mixed, &table);
  context->WriteTable("recalibration", table);
  context->AtMost("change.segments_from_before_in_calibration",
                  after.from_before,
                  0,
                  {.robust = true});
  context->AtMost("change.rotation_error_by_that_with_segments_from_before",
                  after.turn_error_deg / without.turn_error_deg,
                  0.5,
                  {.robust = true});
  const int dimension =
      static_cast<int>(FreeComponents(devices.front().rig).size());
  const auto [low, high] = NeesBounds(dimension, runs, 0.99);
  context->Within("change.recalibration_nees_over_dimension",
                  after.nees,
                  low / dimension,
                  high / dimension);
  context->Progress("calibrations after a shock");
}

}  // namespace selfcal
