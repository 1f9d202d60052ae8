// Does a calibration on the tables reach batch, with the information of all
// segments beside their data? A device is used as the daemon would have it:
// segments come one by one, the tables keep the data of the best, and of each
// other remains what it says, linearised at the newest calibration.
#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/calibration/settled_ends.h"
#include "core/information/fusion.h"
#include "core/information/segment_scorer.h"
#include "core/selection/tables.h"
#include "core/simulation/simulate.h"
#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/parameter_statistics.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

// Of this experiment alone: no threshold was chosen on them.
constexpr int kDevices = 60;
constexpr std::uint64_t kFirstMotion = 20'001;
constexpr std::uint64_t kFirstNoise = 30'001;
// A quarter of the segments of three minutes.
constexpr int kAllSegmentsTableSize = 7;
// The long use: a calibration at each of these numbers of segments.
constexpr double kLongUse_s = 811;
constexpr int kMilestones[] = {12, 25, 50, 100, 200};
constexpr int kLongTableSize = 8;

enum MemoryKind {
  kFromTables,
  kFromScores,
  kFromEnds,
  kFromBatch,
  kMemoryKinds
};
constexpr const char* kAllSegmentsNames[] = {
    "tables alone", "with scores of all", "with ends of all", "batch"};

// A device in use, with the memory of a daemon.
class DeviceInUse {
 public:
  DeviceInUse(const Rig& rig, const std::vector<MotionSegment>& segments)
      : rig_(rig),
        segments_(segments),
        newest_(rig.factory),
        tables_(MakeTables(rig)) {}

  void Take(int i) {
    SegmentInformation score;
    scorer_.Score(rig_, rig_.factory, segments_[i], {}, &score);
    for (std::size_t q = 0; q < tables_.size(); ++q) {
      Offer(
          {segments_[i].key, i, score.groups[q].entropy, score.groups[q].gain},
          rig_.min_gain_nats,
          &tables_[q]);
    }
    memory_.push_back({.has_data = true});
    std::vector<char> kept(memory_.size(), 0);
    for (const TableEntry& entry : UnionOfTables(tables_)) {
      kept[entry.sequence] = 1;
    }
    for (std::size_t j = 0; j < memory_.size(); ++j) {
      if (!kept[j] && memory_[j].has_data) {
        Linearise(static_cast<int>(j));
        memory_[j].has_data = false;
      }
    }
    const bool full = std::all_of(tables_.begin(),
                                  tables_.end(),
                                  [](const Table& t) { return t.full(); });
    if (full && !calibrated_) {
      calibrated_ = true;
      newest_ = Calibrate(kFromEnds).theta;
    }
  }

  SegmentSet kept() const {
    SegmentSet set;
    for (std::size_t i = 0; i < memory_.size(); ++i) {
      if (memory_[i].has_data) set.push_back(static_cast<int>(i));
    }
    return set;
  }

  CalibrationResult Calibrate(MemoryKind kind) {
    CalibrateOptions options = ComparedOptions();
    if (kind == kFromEnds) options.remembered = Remember();
    if (kind == kFromScores) options.prior = PriorByScores();
    const CalibrationResult result = selfcal::Calibrate(
        rig_,
        newest_,
        Pick(segments_, kind == kFromBatch ? Seen() : kept()),
        options);
    if (kind == kFromEnds) reach_ = result.remembered.reach;
    if (result.status != CalibrateStatus::kConverged) {
      throw std::runtime_error(
          fmt::format("a calibration ({}) did not converge: {}",
                      kAllSegmentsNames[kind],
                      result.message));
    }
    return result;
  }
  // The newest version, at which evicted segments are linearised.
  void Activate(const Calibration& theta) { newest_ = theta; }
  double reach() const { return reach_; }

 private:
  struct Remembered {
    bool has_data = false;
    SegmentEnds ends = {};
    SegmentInformation score = {};
  };

  SegmentSet Seen() const {
    return AllSegments(static_cast<int>(memory_.size()));
  }

  void Linearise(int i) {
    memory_[i].ends = SummariseSettledEnds(rig_, newest_, segments_[i]);
    scorer_.Score(rig_, newest_, segments_[i], {}, &memory_[i].score);
  }

  std::vector<RememberedSegment> Remember() const {
    std::vector<RememberedSegment> remembered;
    for (std::size_t i = 0; i < memory_.size(); ++i) {
      RememberedSegment& one = remembered.emplace_back();
      one.key = segments_[i].key;
      if (!memory_[i].has_data) one.ends = memory_[i].ends;
    }
    return remembered;
  }

  // The sum of the scores of evicted segments: each by itself.
  std::optional<ThetaPrior> PriorByScores() const {
    std::vector<SegmentInformation> evicted;
    for (const Remembered& one : memory_) {
      if (!one.has_data) evicted.push_back(one.score);
    }
    if (evicted.empty()) return std::nullopt;
    const FusedEstimate fused = Fuse(rig_, evicted);
    std::vector<int> all(TangentSize(rig_.factory));
    std::iota(all.begin(), all.end(), 0);
    return MarginalPrior(rig_, fused.theta, fused.covariance, all);
  }

  const Rig& rig_;
  const std::vector<MotionSegment>& segments_;
  Calibration newest_;
  bool calibrated_ = false;
  double reach_ = 0;
  std::vector<Table> tables_;
  std::vector<Remembered> memory_;
  SegmentScorer scorer_;
};

struct AllSegmentsDevice {
  Rig rig;
  Calibration truth;
  std::vector<MotionSegment> segments;
};

AllSegmentsDevice Simulated(int index, double duration_s, int table_size) {
  EvaluatedDevice device = MakeDevice();
  device.rig.table_size = table_size;
  SimulationOptions options = DatasetOptions(0);
  options.seed = kFirstNoise + static_cast<std::uint64_t>(index);
  const auto motion =
      MakeMixed(duration_s, kFirstMotion + static_cast<std::uint64_t>(index));
  return {device.rig,
          device.truth,
          Simulate(device.rig,
                   device.truth,
                   device.rig.factory,
                   *motion,
                   "session",
                   options)
              .segments};
}

struct DeviceRun {
  int segments = 0;
  int kept = 0;
  double reach = 0;
  Estimate estimates[kMemoryKinds];
  double nees[kMemoryKinds] = {};
  int degrees = 0;
};

DeviceRun RunDevice(int index, double duration_s, int table_size) {
  const AllSegmentsDevice device = Simulated(index, duration_s, table_size);
  DeviceInUse in_use(device.rig, device.segments);
  DeviceRun run;
  run.segments = static_cast<int>(device.segments.size());
  for (int i = 0; i < run.segments; ++i) in_use.Take(i);
  run.kept = static_cast<int>(in_use.kept().size());
  for (const MemoryKind kind :
       {kFromTables, kFromScores, kFromEnds, kFromBatch}) {
    const CalibrationResult result = in_use.Calibrate(kind);
    run.estimates[kind] = {result.theta,
                           result.covariance.diagonal().cwiseSqrt()};
    const SquaredError error = NormalisedSquaredError(
        BoxMinus(result.theta, device.truth), result.covariance);
    run.nees[kind] = error.nees;
    run.degrees = error.dof;
  }
  run.reach = in_use.reach();
  return run;
}

ParameterStatistics StatisticsOf(MemoryKind kind,
                                 const std::vector<DeviceRun>& runs) {
  std::vector<Estimate> estimates;
  for (const DeviceRun& run : runs) estimates.push_back(run.estimates[kind]);
  return Summarise(MakeDevice().truth, estimates);
}

double MeanNees(MemoryKind kind, const std::vector<DeviceRun>& runs) {
  std::vector<double> nees;
  for (const DeviceRun& run : runs) nees.push_back(run.nees[kind]);
  return Mean(nees);
}

void ReportDevices(const std::vector<DeviceRun>& runs, Context* context) {
  const ParameterStatistics batch = StatisticsOf(kFromBatch, runs);
  const auto count = static_cast<int>(runs.size());
  const auto [low, high] = NeesBounds(runs[0].degrees, count, 0.95);
  ResultTable table({"calibration",
                     "spread / batch, median",
                     "rms error / batch, median",
                     "rms error / batch, over all",
                     "sigma / batch, median",
                     "sigma / batch, largest",
                     "mean NEES",
                     "95 % from",
                     "to"});
  std::vector<std::pair<std::string, ParameterStatistics>> all;
  for (const MemoryKind kind :
       {kFromTables, kFromScores, kFromEnds, kFromBatch}) {
    const ParameterStatistics one = StatisticsOf(kind, runs);
    all.emplace_back(kAllSegmentsNames[kind], one);
    const auto sigmas = Ratios(one.rms_sigma, batch.rms_sigma);
    const auto errors = Ratios(one.rms_error, batch.rms_error);
    table.Add({kAllSegmentsNames[kind],
               MedianOf(Ratios(one.spread, batch.spread)),
               MedianOf(errors),
               Rms(errors),
               MedianOf(sigmas),
               Quantile(sigmas, 1),
               MeanNees(kind, runs),
               low,
               high});
  }
  context->WriteTable("all_segments", table);
  context->WriteTable("parameters", CompareParameters(MakeDevice().truth, all));
  const ParameterStatistics& ends = all[kFromEnds].second;
  context->AtMost("all_segments.spread_ratio_median",
                  MedianOf(Ratios(ends.spread, batch.spread)),
                  1.1);
  context->AtMost("all_segments.error_ratio_median",
                  MedianOf(Ratios(ends.rms_error, batch.rms_error)),
                  1.1);
  context->AtMost("all_segments.sigma_ratio_largest",
                  Quantile(Ratios(ends.rms_sigma, batch.rms_sigma), 1),
                  1.1,
                  {.robust = true});
  double kept = 0, segments = 0;
  for (const DeviceRun& run : runs) {
    kept += run.kept;
    segments += run.segments;
  }
  context->AtMost("all_segments.kept_part", kept / segments, 0.25);
  context->Within(
      "all_segments.nees_mean", MeanNees(kFromEnds, runs), low, high);
}

// Median over the parameters of the sigma against that of another.
double SigmaRatio(const CalibrationResult& a, const CalibrationResult& b) {
  return MedianOf(Ratios(a.covariance.diagonal().cwiseSqrt(),
                         b.covariance.diagonal().cwiseSqrt()));
}

// The sigma goes on falling as the device is used.
void RunLongUse(Context* context) {
  const double duration_s = context->quick() ? 61 : kLongUse_s;
  const int table_size = context->quick() ? 2 : kLongTableSize;
  const AllSegmentsDevice device = Simulated(kDevices, duration_s, table_size);
  DeviceInUse in_use(device.rig, device.segments);
  const auto count = static_cast<int>(device.segments.size());
  ResultTable table({"segments",
                     "kept",
                     "sigma / that of the first, with ends of all",
                     "the same, batch",
                     "the same, tables alone",
                     "with ends of all / batch",
                     "NEES with ends of all"});
  Plot plot{.title = "Sigma of a device in use, tables of 8",
            .x_label = "segments",
            .y_label = "sigma / that of the first calibration (median)",
            .log_x = true,
            .log_y = true};
  Series ends{.label = kAllSegmentsNames[kFromEnds]},
      batch{.label = kAllSegmentsNames[kFromBatch]},
      tables{.label = kAllSegmentsNames[kFromTables]};
  std::optional<CalibrationResult> first;
  double last_ratio = 0;
  int taken = 0;
  for (const int milestone : kMilestones) {
    const int end = std::min(milestone, count);
    if (taken == end) break;
    while (taken < end) in_use.Take(taken++);
    const CalibrationResult informed = in_use.Calibrate(kFromEnds);
    const CalibrationResult all = in_use.Calibrate(kFromBatch);
    const CalibrationResult alone = in_use.Calibrate(kFromTables);
    in_use.Activate(informed.theta);
    if (!first) first = informed;
    last_ratio = SigmaRatio(informed, all);
    const double nees =
        NormalisedSquaredError(BoxMinus(informed.theta, device.truth),
                               informed.covariance)
            .nees;
    table.Add({end,
               static_cast<int>(in_use.kept().size()),
               SigmaRatio(informed, *first),
               SigmaRatio(all, *first),
               SigmaRatio(alone, *first),
               last_ratio,
               nees});
    ends.x.push_back(end);
    ends.y.push_back(SigmaRatio(informed, *first));
    batch.x.push_back(end);
    batch.y.push_back(SigmaRatio(all, *first));
    tables.x.push_back(end);
    tables.y.push_back(SigmaRatio(alone, *first));
    context->Progress(fmt::format("long use, {} segments", end));
  }
  plot.series = {ends, batch, tables};
  context->WriteTable("long_use", table);
  context->WritePlot("long_use", plot);
  context->AtMost("all_segments.long_use_sigma_ratio", last_ratio, 1.1);
}

}  // namespace

void RunAllSegments(Context* context) {
  const int count = context->quick() ? 4 : kDevices;
  const double duration_s = context->quick() ? 41 : kDatasetDuration_s;
  const int table_size = context->quick() ? 2 : kAllSegmentsTableSize;
  std::vector<DeviceRun> runs(static_cast<std::size_t>(count));
  context->ForEach(count, [&](int i) {
    runs[i] = RunDevice(i, duration_s, table_size);
    context->Progress(
        fmt::format("device {}: {} segments, kept {}, reach {:.2f}",
                    i + 1,
                    runs[i].segments,
                    runs[i].kept,
                    runs[i].reach));
  });
  ReportDevices(runs, context);
  RunLongUse(context);
}

}  // namespace selfcal
