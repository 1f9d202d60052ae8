// Noise that is wrong: what it does to estimate and sigma, with and without
// re-weighting.
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/noise_cases.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

struct WrongNoiseScenario {
  std::string name, figure;
  Belief belief;
  double moving_fraction = 0;
};

std::vector<WrongNoiseScenario> WrongNoiseScenarios() {
  const std::vector<NoiseKind> inertial = {NoiseKind::kGyro,
                                           NoiseKind::kAccel,
                                           NoiseKind::kGyroBiasWalk,
                                           NoiseKind::kAccelBiasWalk};
  return {
      {"right", "right", {"", {}, 1}},
      {"IMU densities 10 times too small",
       "imu_too_small",
       {"", inertial, 0.1}},
      {"IMU densities 10 times too large", "imu_too_large", {"", inertial, 10}},
      {"pixel sigma 3 times too small",
       "pixels_too_small",
       {"", {NoiseKind::kPixel}, 1.0 / 3}},
      {"10 % outlier tracks", "outlier_tracks_10", {"", {}, 1}, 0.1},
      {"30 % outlier tracks", "outlier_tracks_30", {"", {}, 1}, 0.3},
  };
}

struct WrongNoiseRun {
  double nees = 0;
  double error_sigmas = 0;    // rms over components, in claimed sigmas
  double sigma_ratio = 0;     // claimed, over that of the right noise; median
  double error_ratio = 0;     // rms error, in sigmas of the right noise
  double largest_sigmas = 0;  // in claimed sigmas
  std::vector<NoiseScale> factors;  // over the truth
};

WrongNoiseRun Measure(const Dataset& dataset,
                      const Rig& rig,
                      const CalibrationResult& right,
                      const CalibrationResult& result) {
  const std::vector<int> free = FreeComponents(rig);
  const Eigen::VectorXd error = BoxMinus(result.theta, dataset.truth)(free);
  const Eigen::ArrayXd sigmas =
      result.covariance.diagonal()(free).cwiseSqrt().array();
  const Eigen::ArrayXd right_sigmas =
      right.covariance.diagonal()(free).cwiseSqrt().array();
  const Eigen::ArrayXd in_sigmas = error.array() / sigmas;
  const Eigen::ArrayXd ratios = sigmas / right_sigmas;
  return {
      .nees = NormalisedSquaredError(BoxMinus(result.theta, dataset.truth),
                                     result.covariance)
                  .nees,
      .error_sigmas = std::sqrt(in_sigmas.square().mean()),
      .sigma_ratio = MedianOf({ratios.begin(), ratios.end()}),
      .error_ratio = std::sqrt((error.array() / right_sigmas).square().mean()),
      .largest_sigmas = in_sigmas.abs().maxCoeff(),
      .factors = OverTruth(result, rig, dataset.rig)};
}

// By scenario.
struct Runs {
  std::vector<WrongNoiseRun> stated, reweighted;
};

Runs RunScenarios(int index, double duration_s) {
  Runs runs;
  CalibrationResult right;
  for (const WrongNoiseScenario& scenario : WrongNoiseScenarios()) {
    SimulationOptions options = DatasetOptions(index);
    options.moving_fraction = scenario.moving_fraction;
    const Dataset dataset =
        MakeDataset(index, duration_s, WithNoise(10), options);
    const Rig rig = Believe(dataset.rig, scenario.belief);
    const auto calibrate = [&](bool reweight) {
      return Calibrate(
          rig, rig.factory, dataset.segments(), {.reweight_noise = reweight});
    };
    const CalibrationResult stated = calibrate(false);
    if (runs.stated.empty()) right = stated;
    runs.stated.push_back(Measure(dataset, rig, right, stated));
    runs.reweighted.push_back(Measure(dataset, rig, right, calibrate(true)));
  }
  return runs;
}

// Of one scenario and way to weight, over datasets.
struct WrongNoiseSummary {
  std::vector<WrongNoiseRun> runs;

  std::vector<double> Each(double WrongNoiseRun::*figure) const {
    std::vector<double> values;
    for (const WrongNoiseRun& run : runs) values.push_back(run.*figure);
    return values;
  }
  double MeanOf(double WrongNoiseRun::*figure) const {
    return Mean(Each(figure));
  }
  // NaN where no run has it.
  double MedianFactor(NoiseKind kind) const {
    std::vector<double> values;
    for (const WrongNoiseRun& run : runs) {
      for (const NoiseScale& factor : run.factors) {
        if (factor.kind == kind) values.push_back(factor.factor);
      }
    }
    return values.empty() ? std::numeric_limits<double>::quiet_NaN()
                          : MedianOf(values);
  }
};

std::vector<Cell> RowOf(const std::string& scenario,
                        bool reweighted,
                        const WrongNoiseSummary& summary) {
  std::vector<Cell> row = {
      scenario,
      reweighted ? "re-weighted" : "as stated",
      summary.MeanOf(&WrongNoiseRun::error_ratio),
      summary.MeanOf(&WrongNoiseRun::sigma_ratio),
      summary.MeanOf(&WrongNoiseRun::error_sigmas),
      Quantile(summary.Each(&WrongNoiseRun::largest_sigmas), 1),
      summary.MeanOf(&WrongNoiseRun::nees)};
  for (const NoiseKind kind : AllKinds()) {
    row.push_back(summary.MedianFactor(kind));
  }
  return row;
}

void CheckScenario(const WrongNoiseScenario& scenario,
                   const WrongNoiseSummary& stated,
                   const WrongNoiseSummary& reweighted,
                   Context* context) {
  const int D = static_cast<int>(FreeComponents(MakeDevice().rig).size());
  const auto [low, high] =
      NeesBounds(D, static_cast<int>(stated.runs.size()), 0.95);
  const std::string name = "wrong_noise." + scenario.figure;
  if (scenario.moving_fraction > 0) {
    context->AtMost(name + "_error_rms_in_claimed_sigmas",
                    stated.MeanOf(&WrongNoiseRun::error_sigmas),
                    1.3);
    return;
  }
  context->Within(name + "_reweighted_nees",
                  reweighted.MeanOf(&WrongNoiseRun::nees),
                  low,
                  high);
  if (scenario.belief.factor == 1) return;
  context->AtMost(name + "_reweighted_error_over_stated",
                  reweighted.MeanOf(&WrongNoiseRun::error_ratio) /
                      stated.MeanOf(&WrongNoiseRun::error_ratio),
                  1);
}

void MeasureWrongNoise(Context* context) {
  const int datasets = context->quick() ? 1 : 6;
  const double duration_s = context->quick() ? 8.5 : 24.5;
  std::vector<Runs> all(datasets);
  context->ForEach(datasets, [&](int i) {
    all[i] = RunScenarios(i, duration_s);
    context->Progress("wrong noise, dataset " + std::to_string(i + 1));
  });

  ResultTable table({"scenario",
                     "noise",
                     "error, rms [sigma of the right noise]",
                     "claimed sigma over that of the right noise",
                     "error, rms [claimed sigma]",
                     "largest error [claimed sigma]",
                     "NEES, mean",
                     "pixel",
                     "gyro",
                     "accel",
                     "gyro bias walk",
                     "accel bias walk"});
  Plot plot{.title = "Noise that is wrong",
            .y_label = "error of theta, rms [claimed sigma]",
            .log_y = true,
            .horizontal = {1},
            .series = {{.label = "as stated", .style = SeriesStyle::kBars},
                       {.label = "re-weighted", .style = SeriesStyle::kBars}}};
  const std::vector<WrongNoiseScenario> scenarios = WrongNoiseScenarios();
  for (std::size_t s = 0; s < scenarios.size(); ++s) {
    WrongNoiseSummary stated, reweighted;
    for (const Runs& runs : all) {
      stated.runs.push_back(runs.stated[s]);
      reweighted.runs.push_back(runs.reweighted[s]);
    }
    table.Add(RowOf(scenarios[s].name, false, stated));
    table.Add(RowOf(scenarios[s].name, true, reweighted));
    plot.categories.push_back(scenarios[s].name);
    plot.series[0].y.push_back(stated.MeanOf(&WrongNoiseRun::error_sigmas));
    plot.series[1].y.push_back(reweighted.MeanOf(&WrongNoiseRun::error_sigmas));
    CheckScenario(scenarios[s], stated, reweighted, context);
  }
  context->WriteTable("wrong_noise", table);
  context->WritePlot("wrong_noise", plot);
}

}  // namespace

void RunWrongNoise(Context* context) { MeasureWrongNoise(context); }

}  // namespace selfcal
