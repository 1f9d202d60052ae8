// Does the sparsified problem match batch? Table I of the paper, with errors
// against truth and the sigmas that each claims.
#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/information_gain.h"
#include "test/evaluation/parameter_statistics.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

// What the tables of the rig give, another size of them, batch, and the
// incremental information gain.
enum MatchKind {
  kMatchInformative,
  kMatchOneBound,
  kMatchBatch,
  kMatchGain,
  kMatchKinds
};
constexpr const char* kBatchMatchNames[] = {
    "informative", "single bound", "batch", "information gain"};

struct BatchMatchDatasetRun {
  std::string name;
  bool whole = false;  // of full length
  int segments = 0;
  int kept[kMatchKinds] = {};
  Estimate estimates[kMatchKinds];
};

Estimate ToEstimate(const CalibrationResult& result) {
  return {result.theta, result.covariance.diagonal().cwiseSqrt()};
}

BatchMatchDatasetRun RunDataset(int index, double duration_s, int table_size) {
  Dataset dataset = MakeDataset(index, duration_s);
  dataset.rig.table_size = table_size;
  const std::vector<MotionSegment>& segments = dataset.segments();
  const auto count = static_cast<int>(segments.size());
  BatchMatchDatasetRun run;
  run.name = dataset.name;
  run.whole = dataset.duration_s >= duration_s;
  run.segments = count;
  const auto add = [&](MatchKind kind,
                       const SegmentSet& set,
                       const CalibrationResult& result) {
    run.kept[kind] = static_cast<int>(set.size());
    run.estimates[kind] = ToEstimate(result);
  };
  const std::vector<SegmentInformation> scores =
      ScoreAll(dataset.rig, segments);
  const SegmentSet informative = MostInformative(dataset.rig, scores);
  add(kMatchInformative,
      informative,
      CalibrateOn(dataset.rig, segments, informative));
  const SegmentSet single =
      SingleGroup(dataset.rig, dataset.rig.table_size, scores);
  add(kMatchOneBound, single, CalibrateOn(dataset.rig, segments, single));
  const SegmentSet all = AllSegments(count);
  add(kMatchBatch, all, CalibrateOn(dataset.rig, segments, all));
  const GainResult gain = RunInformationGain(dataset.rig, segments, {});
  add(kMatchGain, gain.kept, gain.calibration);
  return run;
}

ParameterStatistics StatisticsOf(
    MatchKind kind, const std::vector<BatchMatchDatasetRun>& runs) {
  std::vector<Estimate> estimates;
  for (const BatchMatchDatasetRun& run : runs)
    estimates.push_back(run.estimates[kind]);
  return Summarise(MakeDevice().truth, estimates);
}

// Kept segments as a part of all, over the datasets together.
double KeptPart(MatchKind kind,
                bool whole_ones_alone,
                const std::vector<BatchMatchDatasetRun>& runs) {
  double kept = 0;
  double all = 0;
  for (const BatchMatchDatasetRun& run : runs) {
    if (whole_ones_alone && !run.whole) continue;
    kept += run.kept[kind];
    all += run.segments;
  }
  return kept / all;
}

void WriteSegments(const std::vector<BatchMatchDatasetRun>& runs,
                   const Context& context) {
  ResultTable table({"dataset",
                     "segments",
                     "informative",
                     "single bound",
                     "information gain"});
  for (const BatchMatchDatasetRun& run : runs) {
    table.Add({run.name,
               run.segments,
               run.kept[kMatchInformative],
               run.kept[kMatchOneBound],
               run.kept[kMatchGain]});
  }
  context.WriteTable("segments", table);
}

// The means of rotations as the paper gives them.
void WriteRotations(
    const std::vector<std::pair<std::string, ParameterStatistics>>& all,
    const Context& context) {
  constexpr double kDegrees = 180 / 3.14159265358979323846;
  const Calibration truth = MakeDevice().truth;
  const int camera = CameraTangentOffset(truth, 0) + kCameraRotation;
  ResultTable table({"estimator",
                     "accelerometer against gyroscope [deg]",
                     "sd [deg]",
                     "camera against IMU, from truth [deg]",
                     "sd [deg]"});
  for (const auto& [name, statistics] : all) {
    const Calibration& average = statistics.average;
    table.Add({name,
               kDegrees * average.imu.q_AI.angularDistance(
                              Eigen::Quaterniond::Identity()),
               kDegrees * statistics.spread.segment<3>(kAccelRotation).norm(),
               kDegrees * average.cameras[0].q_CI.angularDistance(
                              truth.cameras[0].q_CI),
               kDegrees * statistics.spread.segment<3>(camera).norm()});
  }
  context.WriteTable("rotations", table);
}

void PlotSpreads(const ParameterStatistics& batch,
                 const ParameterStatistics& informative,
                 const ParameterStatistics& gain,
                 const Context& context) {
  Plot plot{.title = "Spread over the datasets, against that of batch",
            .y_label = "sd / sd of batch",
            .horizontal = {1, 1.5}};
  const Rig rig = MakeDevice().rig;
  const auto components = TangentComponents(rig.factory);
  for (const int i : FreeComponents(rig)) {
    plot.categories.push_back(components[i].name);
  }
  plot.series = {{.label = "informative",
                  .style = SeriesStyle::kBars,
                  .y = Ratios(informative.spread, batch.spread)},
                 {.label = "information gain",
                  .style = SeriesStyle::kBars,
                  .y = Ratios(gain.spread, batch.spread)}};
  context.WritePlot("spreads", plot);
}

void CheckFigures(const std::vector<BatchMatchDatasetRun>& runs,
                  Context* context) {
  const ParameterStatistics batch = StatisticsOf(kMatchBatch, runs);
  const ParameterStatistics informative = StatisticsOf(kMatchInformative, runs);
  const std::vector<double> spreads = Ratios(informative.spread, batch.spread);
  context->AtMost(
      "batch_match.spread_ratio_median.goal", MedianOf(spreads), 1.5);
  context->AtMost(
      "batch_match.spread_ratio_largest.goal", Quantile(spreads, 1), 1.5);
  context->AtMost("batch_match.sigma_ratio_median.goal",
                  MedianOf(Ratios(informative.rms_sigma, batch.rms_sigma)),
                  1.5);
  context->AtMost("batch_match.error_ratio_median.goal",
                  MedianOf(Ratios(informative.rms_error, batch.rms_error)),
                  1.5);
  context->AtMost("batch_match.kept_part_of_three_minutes",
                  KeptPart(kMatchInformative, true, runs),
                  0.25);
  context->AtMost("batch_match.kept_part_of_all",
                  KeptPart(kMatchInformative, false, runs),
                  0.25);
  // A fair claim: of an estimator whose sigma is right, the rms error is one
  // sigma; over all parameters and datasets.
  for (const MatchKind kind : {kMatchInformative, kMatchBatch, kMatchGain}) {
    const ParameterStatistics one = StatisticsOf(kind, runs);
    std::string name = kBatchMatchNames[kind];
    std::replace(name.begin(), name.end(), ' ', '_');
    context->Within("batch_match.error_in_sigmas_" + name,
                    Rms(Ratios(one.rms_error, one.rms_sigma)),
                    0.8,
                    1.25,
                    {.unit = "sigma"});
  }
}

}  // namespace

void RunBatchMatch(Context* context) {
  const int count = context->quick() ? 3 : kDatasets;
  const double duration_s = context->quick() ? 29 : kDatasetDuration_s;
  const int table_size = context->quick() ? 2 : 8;
  std::vector<BatchMatchDatasetRun> runs(static_cast<std::size_t>(count));
  context->ForEach(count, [&](int i) {
    runs[i] = RunDataset(i, duration_s, table_size);
    context->Progress(fmt::format("{}: {} segments, kept {}, gain {}",
                                  runs[i].name,
                                  runs[i].segments,
                                  runs[i].kept[kMatchInformative],
                                  runs[i].kept[kMatchGain]));
  });
  std::vector<std::pair<std::string, ParameterStatistics>> all;
  for (const MatchKind kind :
       {kMatchInformative, kMatchOneBound, kMatchBatch, kMatchGain}) {
    all.emplace_back(kBatchMatchNames[kind], StatisticsOf(kind, runs));
  }
  context->WriteTable("parameters", CompareParameters(MakeDevice().truth, all));
  WriteRotations(all, *context);
  WriteSegments(runs, *context);
  PlotSpreads(all[kMatchBatch].second,
              all[kMatchInformative].second,
              all[kMatchGain].second,
              *context);
  CheckFigures(runs, context);
}

}  // namespace selfcal
