// What the other experiments stand on: motion and size of each dataset, and
// what its segments gain for each group.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "core/information/segment_information.h"
#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

struct Measured {
  std::string name;
  bool recorded = false;
  double duration_s = 0;
  double path_m = 0;
  double accel_rms_mps2 = 0;
  double rate_rms_radps = 0;
  long segments = 0;
  long landmarks = 0;                      // in each segment, mean
  long observations = 0;                   // in each segment, mean
  std::vector<std::vector<double>> gains;  // by group, by segment
};

void MeasureMotion(const Trajectory& trajectory, Measured* measured) {
  constexpr double kStep_s = 0.01;
  std::vector<double> accelerations;
  std::vector<double> rates;
  for (double t_s = 0; t_s <= trajectory.duration_s(); t_s += kStep_s) {
    const BodyMotion motion = trajectory.At(t_s);
    measured->path_m += kStep_s * motion.v_GI.norm();
    accelerations.push_back(motion.a_GI.norm());
    rates.push_back(motion.w_I.norm());
  }
  measured->accel_rms_mps2 = Rms(accelerations);
  measured->rate_rms_radps = Rms(rates);
}

Measured Measure(int index, double duration_s) {
  const Dataset dataset = MakeDataset(index, duration_s);
  Measured measured;
  measured.name = dataset.name;
  measured.recorded = dataset.recorded;
  measured.duration_s = dataset.duration_s;
  MeasureMotion(*MakeMotion(index, duration_s).trajectory, &measured);
  measured.segments = static_cast<long>(dataset.segments().size());
  measured.gains.resize(dataset.rig.groups.size());
  for (const MotionSegment& segment : dataset.segments()) {
    measured.landmarks += static_cast<long>(segment.landmarks.size());
    measured.observations += static_cast<long>(segment.observations.size());
    const SegmentInformation information =
        ScoreSegment(dataset.rig, dataset.rig.factory, segment);
    for (std::size_t q = 0; q < information.groups.size(); ++q) {
      measured.gains[q].push_back(information.groups[q].gain);
    }
  }
  measured.landmarks /= measured.segments;
  measured.observations /= measured.segments;
  return measured;
}

void PlotGains(const std::vector<Measured>& all, Context* context) {
  const std::vector<ParameterGroup> groups = MakeDevice().rig.groups;
  Plot plot{.title = "What a segment says, by dataset",
            .x_label = "dataset",
            .y_label = "gain, median with quartiles [nat]"};
  for (std::size_t q = 0; q < groups.size(); ++q) {
    Series series{.label = groups[q].name, .style = SeriesStyle::kScatter};
    for (std::size_t i = 0; i < all.size(); ++i) {
      const std::vector<double>& gains = all[i].gains[q];
      series.x.push_back(static_cast<double>(i + 1) +
                         0.2 * (static_cast<double>(q) - 1));
      series.y.push_back(MedianOf(gains));
      series.low.push_back(Quantile(gains, 0.25));
      series.high.push_back(Quantile(gains, 0.75));
    }
    plot.series.push_back(series);
  }
  context->WritePlot("gains", plot);
}

}  // namespace

void RunDatasets(Context* context) {
  const double duration_s = context->quick() ? 20 : kDatasetDuration_s;
  std::vector<Measured> all(kDatasets);
  context->ForEach(kDatasets, [&](int i) {
    all[i] = Measure(i, duration_s);
    context->Progress(all[i].name);
  });
  ResultTable table({"dataset",
                     "recorded",
                     "duration [s]",
                     "path [m]",
                     "acceleration rms [m/s^2]",
                     "rate rms [rad/s]",
                     "segments",
                     "landmarks a segment",
                     "observations a segment"});
  double segments = 0;
  for (const Measured& one : all) {
    table.Add({one.name,
               one.recorded ? "yes" : "no",
               one.duration_s,
               one.path_m,
               one.accel_rms_mps2,
               one.rate_rms_radps,
               one.segments,
               one.landmarks,
               one.observations});
    segments += static_cast<double>(one.segments);
  }
  context->WriteTable("datasets", table);
  PlotGains(all, context);
  context->AtLeast("datasets.segments_mean",
                   segments / kDatasets,
                   context->quick() ? 4 : 32,
                   {.unit = "segments", .robust = true});
}

}  // namespace selfcal
