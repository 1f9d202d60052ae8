// The one-step estimate from stored information of all segments against the
// full solve on their data: how far, and when is it enough.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/information/fusion.h"
#include "core/information/segment_information.h"
#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

// What a linearisation point is off by, against a factory's error.
constexpr double kScales[] = {0.1, 0.3, 0.6, 1};

const CheckOptions kSigmas{.unit = "sigma"};

CalibrationError Scaled(double scale) {
  CalibrationError error;
  error.focal_relative *= scale;
  error.principal_point_px *= scale;
  error.distortion_relative *= scale;
  error.camera_rotation_rad *= scale;
  error.camera_position_m *= scale;
  error.scale *= scale;
  error.misalignment *= scale;
  error.accel_rotation_rad *= scale;
  return error;
}

// The same readings, with states and landmarks that are right.
MotionSegment AtTrueStates(MotionSegment segment, const MotionSegment& truth) {
  segment.keyframes = truth.keyframes;
  segment.landmarks = truth.landmarks;
  return segment;
}

// a [-] b in the metric of a covariance at b, over D.
double SquareDistance(const Calibration& a,
                      const Calibration& b,
                      const Eigen::MatrixXd& covariance) {
  const auto [square, dof] = NormalisedSquaredError(BoxMinus(a, b), covariance);
  return square / dof;
}

struct FusionOutcome {
  std::string dataset;
  double scale = 0;
  long segments = 0;
  double reach = 0;        // from linearisation to estimate [sigma_ref]
  double to_full = 0;      // fused from full, in sigmas of the full (rms)
  double true_states = 0;  // the same, scored at the true states
  double error = 0;        // fused from truth [sigma_ref], rms
  double full_error = 0;   // full from truth [sigma_ref], rms
  double nees = 0;         // fused from truth, over D
  double full_nees = 0;
  double heterogeneity = 0;
};

FusionOutcome Evaluate(int dataset, double scale, double duration_s) {
  EvaluatedDevice device = MakeDevice();
  device.rig.factory = PerturbCalibration(
      device.truth, Scaled(scale), 900 + static_cast<std::uint64_t>(dataset));
  const Dataset data =
      MakeDataset(dataset, duration_s, device, DatasetOptions(dataset));
  std::vector<SegmentInformation> stored, at_true_states;
  for (std::size_t i = 0; i < data.segments().size(); ++i) {
    const MotionSegment& segment = data.segments()[i];
    stored.push_back(ScoreSegment(data.rig, data.rig.factory, segment));
    at_true_states.push_back(
        ScoreSegment(data.rig,
                     data.rig.factory,
                     AtTrueStates(segment, data.session.truth[i])));
  }
  const FusedEstimate fused = Fuse(data.rig, stored);
  const FusedEstimate fused_true = Fuse(data.rig, at_true_states);
  const CalibrationResult full =
      Calibrate(data.rig, data.rig.factory, data.segments(), ComparedOptions());
  const std::vector<int> free = FreeComponents(data.rig);
  const Eigen::VectorXd reference = ReferenceSigmas(data.rig);
  const auto rms = [&](const Calibration& a, const Calibration& b) {
    const Eigen::VectorXd d = BoxMinus(a, b).cwiseQuotient(reference)(free);
    return Rms({d.begin(), d.end()});
  };
  FusionOutcome outcome;
  outcome.dataset = data.name;
  outcome.scale = scale;
  outcome.segments = static_cast<long>(stored.size());
  outcome.reach = fused.reach;
  outcome.to_full =
      std::sqrt(SquareDistance(fused.theta, full.theta, full.covariance));
  outcome.true_states =
      std::sqrt(SquareDistance(fused_true.theta, full.theta, full.covariance));
  outcome.error = rms(fused.theta, data.truth);
  outcome.full_error = rms(full.theta, data.truth);
  outcome.nees = SquareDistance(data.truth, fused.theta, fused.covariance);
  outcome.full_nees = SquareDistance(data.truth, full.theta, full.covariance);
  outcome.heterogeneity = fused.heterogeneity;
  return outcome;
}

void PlotDistances(const std::vector<FusionOutcome>& all,
                   const Context& context) {
  Plot plot{.title = "The fused estimate, by how far it was linearised",
            .x_label = "reach [sigma_ref]",
            .y_label = "distance [sigma of the full solve]",
            .log_x = true,
            .log_y = true,
            .horizontal = {1}};
  Series from_full{.label = "fused from full", .style = SeriesStyle::kScatter};
  Series at_truth{.label = "the same, scored at true states",
                  .style = SeriesStyle::kScatter};
  for (const FusionOutcome& one : all) {
    from_full.x.push_back(one.reach);
    from_full.y.push_back(one.to_full);
    at_truth.x.push_back(one.reach);
    at_truth.y.push_back(one.true_states);
  }
  plot.series = {from_full, at_truth};
  context.WritePlot("distance", plot);
}

}  // namespace

void RunFusion(Context* context) {
  const int datasets = context->quick() ? 1 : 10;
  const double duration_s = context->quick() ? 16.1 : 80.1;
  const int scales = static_cast<int>(std::size(kScales));
  std::vector<FusionOutcome> all(datasets * scales);
  context->ForEach(datasets * scales, [&](int i) {
    all[i] = Evaluate(i % datasets, kScales[i / datasets], duration_s);
    context->Progress(all[i].dataset + " at " + std::to_string(all[i].scale));
  });
  ResultTable table({"linearisation error / factory's",
                     "dataset",
                     "segments",
                     "reach [sigma_ref]",
                     "fused from full [sigma]",
                     "at true states [sigma]",
                     "fused from truth [sigma_ref]",
                     "full from truth [sigma_ref]",
                     "NEES / D fused",
                     "NEES / D full",
                     "heterogeneity"});
  for (const FusionOutcome& one : all) {
    table.Add({one.scale,
               one.dataset,
               one.segments,
               one.reach,
               one.to_full,
               one.true_states,
               one.error,
               one.full_error,
               one.nees,
               one.full_nees,
               one.heterogeneity});
  }
  context->WriteTable("fusion", table);
  PlotDistances(all, *context);
  for (const double scale : kScales) {
    std::vector<double> to_full, nees;
    for (const FusionOutcome& one : all) {
      if (one.scale != scale) continue;
      to_full.push_back(one.to_full);
      nees.push_back(one.nees);
    }
    const std::string at = fmt::format("_at_{:g}", scale);
    // Nearer to the full solve than that is to the truth.
    context->AtMost("fusion.from_full" + at, Rms(to_full), 1, kSigmas);
    context->AtMost("fusion.nees_by_dof" + at, Mean(nees), 1.25);
  }
  // The rule for use: a reach that is short enough.
  double largest = 0;
  long enough = 0;
  for (const FusionOutcome& one : all) {
    if (one.reach > kEnoughReach) continue;
    ++enough;
    largest = std::max(largest, one.to_full);
  }
  context->AtLeast("fusion.datasets_in_reach", static_cast<double>(enough), 1);
  context->AtMost("fusion.from_full_in_reach_largest", largest, 1.5, kSigmas);
}

}  // namespace selfcal
