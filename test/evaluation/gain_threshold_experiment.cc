// The best configuration of the incremental information gain: how many segments
// it keeps, and how sure it is, by threshold; on motions of their own, that no
// other experiment uses. The best is the lowest threshold (the more segments,
// the better the estimate) that keeps no more segments than the tables do.
#include <fmt/format.h>

#include <vector>

#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/information_gain.h"
#include "test/evaluation/parameter_statistics.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kOwnSeed = 900;

struct Trial {
  double kept = 0;   // segments
  double sigma = 0;  // claimed, against that of the tables' segments; median
  double error = 0;  // rms over the components, in sigmas of the tables
};

struct Scene {
  EvaluatedDevice device;
  std::vector<MotionSegment> segments;
  double informative = 0;  // segments of the tables
  Eigen::VectorXd sigma;   // of the calibration on those
};

Scene MakeScene(int index, double duration_s) {
  const auto seed = kOwnSeed + static_cast<std::uint64_t>(index);
  SimulationOptions options = DatasetOptions(index);
  options.seed = seed;
  Scene scene{.device = MakeDevice(), .segments = {}, .sigma = {}};
  scene.segments = Simulate(scene.device.rig,
                            scene.device.truth,
                            scene.device.rig.factory,
                            *MakeMixed(duration_s, seed),
                            "threshold",
                            options)
                       .segments;
  const SegmentSet kept = MostInformative(
      scene.device.rig, ScoreAll(scene.device.rig, scene.segments));
  scene.informative = static_cast<double>(kept.size());
  scene.sigma = CalibrateOn(scene.device.rig, scene.segments, kept)
                    .covariance.diagonal()
                    .cwiseSqrt();
  return scene;
}

Trial Try(const Scene& scene, double threshold_nats) {
  const GainResult gain = RunInformationGain(
      scene.device.rig, scene.segments, {.threshold_nats = threshold_nats});
  const CalibrationResult& result = gain.calibration;
  return {.kept = static_cast<double>(gain.kept.size()),
          .sigma = MedianOf(
              Ratios(result.covariance.diagonal().cwiseSqrt(), scene.sigma)),
          .error = Rms(
              Ratios(BoxMinus(result.theta, scene.device.truth), scene.sigma))};
}

}  // namespace

void RunGainThreshold(Context* context) {
  const int scenes = context->quick() ? 1 : 2;
  const double duration_s = context->quick() ? 29 : kDatasetDuration_s;
  const std::vector<double> thresholds =
      context->quick() ? std::vector<double>{1, 2}
                       : std::vector<double>{0.25, 0.5, 1, 1.25, 1.5, 2, 3};
  const auto count = static_cast<int>(thresholds.size());
  std::vector<Scene> made(static_cast<std::size_t>(scenes));
  context->ForEach(scenes, [&](int i) { made[i] = MakeScene(i, duration_s); });
  std::vector<Trial> trials(static_cast<std::size_t>(count * scenes));
  context->ForEach(count * scenes, [&](int n) {
    trials[n] = Try(made[n % scenes], thresholds[n / scenes]);
    context->Progress(fmt::format("threshold {} nat, scene {}: kept {}",
                                  thresholds[n / scenes],
                                  n % scenes,
                                  trials[n].kept));
  });
  double informative = 0;
  for (const Scene& scene : made) informative += scene.informative / scenes;
  ResultTable table({"threshold [nat]",
                     "segments kept",
                     "segments of the tables",
                     "sigma against the tables'",
                     "rms error [sigma of the tables]"});
  double kept_at_default = 0;
  for (int t = 0; t < count; ++t) {
    Trial mean;
    for (int i = 0; i < scenes; ++i) {
      const Trial& trial = trials[t * scenes + i];
      mean.kept += trial.kept / scenes;
      mean.sigma += trial.sigma / scenes;
      mean.error += trial.error / scenes;
    }
    table.Add({thresholds[t], mean.kept, informative, mean.sigma, mean.error});
    if (thresholds[t] == GainOptions().threshold_nats) {
      kept_at_default = mean.kept;
    }
  }
  context->WriteTable("thresholds", table);
  context->AtMost(
      "gain_threshold.kept_against_tables", kept_at_default / informative, 1);
}

}  // namespace selfcal
