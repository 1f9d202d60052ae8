// By which factors the noise of a rig is off, from the residuals of a
// calibration: what is found, and what that costs.
#include <algorithm>
#include <cmath>
#include <ctime>
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

// The IMU of the hand-held device is so good against its camera that it takes
// three minutes to tell the noise of its gyroscope; one that is 30 times worse
// shows all kinds in half of one.
struct NoiseFactorsDevice {
  std::string name, figure;
  double inertial_factor = 1;
  double duration_s = 0;
  std::vector<NoiseKind> kinds;  // that are stated wrongly
};

std::vector<NoiseFactorsDevice> Devices(bool quick) {
  const std::vector<NoiseKind> white = {
      NoiseKind::kPixel, NoiseKind::kGyro, NoiseKind::kAccel};
  std::vector<NoiseFactorsDevice> devices = {
      {"IMU 30 times worse", "worse_imu", 30, quick ? 8.5 : 24.5, white}};
  if (!quick) {
    devices[0].kinds = AllKinds();
    devices.push_back({"hand-held", "hand_held", 1, kDatasetDuration_s, white});
  }
  return devices;
}

// Each kind alone off by 3 either way, and all of them.
std::vector<Belief> Beliefs(const NoiseFactorsDevice& device) {
  std::vector<Belief> beliefs = {{"right", {}, 1}};
  for (const double off : {1.0 / 3, 3.0}) {
    const std::string way = off < 1 ? "3 times too small" : "3 times too large";
    for (const NoiseKind kind : device.kinds) {
      beliefs.push_back({NoiseKindName(kind) + " " + way, {kind}, off});
    }
    if (device.inertial_factor > 1) {
      beliefs.push_back({"all " + way, AllKinds(), off});
    }
  }
  return beliefs;
}

// Devices by which the accuracy of the noise scales is measured: the chance in
// four datasets is as large as the errors.
constexpr int kAccuracyDevices = 20;
constexpr int kQuickAccuracyDevices = 2;
constexpr std::uint64_t kAccuracyFirstSeed = 5000;
constexpr double kSpreadProbability = 0.95;

// Of one dataset: found factors over the truth, by belief and kind.
using FoundFactors = std::vector<std::vector<NoiseScale>>;

FoundFactors Find(const NoiseFactorsDevice& device, int index) {
  const Dataset dataset = MakeDataset(index,
                                      device.duration_s,
                                      WithNoise(device.inertial_factor),
                                      DatasetOptions(index));
  FoundFactors found;
  for (const Belief& belief : Beliefs(device)) {
    const Rig rig = Believe(dataset.rig, belief);
    found.push_back(OverTruth(
        Calibrate(rig, rig.factory, dataset.segments()), rig, dataset.rig));
  }
  return found;
}

// Of one kind, over datasets.
std::vector<double> Over(const std::vector<FoundFactors>& found,
                         std::size_t belief,
                         NoiseKind kind,
                         double NoiseScale::*figure) {
  std::vector<double> values;
  for (const FoundFactors& of_dataset : found) {
    for (const NoiseScale& factor : of_dataset[belief]) {
      if (factor.kind == kind) values.push_back(factor.*figure);
    }
  }
  return values;
}

bool IsWhite(NoiseKind kind) {
  return kind == NoiseKind::kPixel || kind == NoiseKind::kGyro ||
         kind == NoiseKind::kAccel;
}

// Of a kind that is stated wrongly by 3, alone or with all others.
void CheckFound(const NoiseFactorsDevice& device,
                NoiseKind kind,
                const std::vector<FoundFactors>& found,
                Context* context) {
  const std::vector<Belief> beliefs = Beliefs(device);
  std::vector<double> ratios;
  for (std::size_t b = 0; b < beliefs.size(); ++b) {
    const std::vector<NoiseKind>& wrong = beliefs[b].kinds;
    if (std::find(wrong.begin(), wrong.end(), kind) == wrong.end()) continue;
    for (const double ratio : Over(found, b, kind, &NoiseScale::factor)) {
      ratios.push_back(ratio);
    }
  }
  double worst = 0;
  for (const double ratio : ratios)
    worst = std::max(worst, std::abs(ratio - 1));
  const std::string name = "noise_factors." + device.figure + "_" +
                           NoiseKindName(kind) + "_off_by_3";
  context->AtMost(name + "_worst_error", worst, 0.2);
  context->Within(name + "_mean_ratio", Mean(ratios), 0.9, 1.1);
}

void AddFound(const NoiseFactorsDevice& device,
              const std::vector<FoundFactors>& found,
              ResultTable* table) {
  const std::vector<Belief> beliefs = Beliefs(device);
  for (std::size_t b = 0; b < beliefs.size(); ++b) {
    for (const NoiseKind kind : AllKinds()) {
      const auto over = [&](double NoiseScale::*figure) {
        return Over(found, b, kind, figure);
      };
      const std::vector<double> ratios = over(&NoiseScale::factor);
      if (ratios.empty()) continue;
      const std::vector<double> log_sigmas = over(&NoiseScale::log_sigma);
      table->Add({device.name,
                  beliefs[b].name,
                  NoiseKindName(kind),
                  Mean(ratios),
                  Quantile(ratios, 0),
                  Quantile(ratios, 1),
                  MedianOf(log_sigmas),
                  MedianOf(over(&NoiseScale::redundancy)),
                  std::to_string(std::count_if(
                      log_sigmas.begin(),
                      log_sigmas.end(),
                      [](double x) { return x < kDeterminedLogSigma; })) +
                      " of " + std::to_string(found.size())});
    }
  }
}

// The error of what is said to be determined, in all cases.
double WorstDetermined(const std::vector<FoundFactors>& found) {
  double worst = 0;
  for (const FoundFactors& of_dataset : found) {
    for (const std::vector<NoiseScale>& of_belief : of_dataset) {
      for (const NoiseScale& factor : of_belief) {
        if (!factor.determined()) continue;
        worst = std::max(worst, std::abs(factor.factor - 1));
      }
    }
  }
  return worst;
}

void FindFactors(Context* context) {
  ResultTable table({"device",
                     "the rig states",
                     "kind",
                     "found over truth, mean",
                     "smallest",
                     "largest",
                     "claimed sigma of its logarithm",
                     "redundancy",
                     "determined in"});
  double worst = 0;
  for (const NoiseFactorsDevice& device : Devices(context->quick())) {
    const int datasets =
        context->quick() ? 1 : (device.inertial_factor > 1 ? 4 : 2);
    std::vector<FoundFactors> found(datasets);
    context->ForEach(datasets, [&](int i) {
      found[i] = Find(device, i);
      context->Progress(device.name + ", dataset " + std::to_string(i + 1));
    });
    AddFound(device, found, &table);
    for (const NoiseKind kind : AllKinds()) {
      if (IsWhite(kind)) CheckFound(device, kind, found, context);
    }
    worst = std::max(worst, WorstDetermined(found));
  }
  context->WriteTable("factors", table);
  context->AtMost(
      "noise_factors.worst_error_of_a_determined_factor", worst, 0.2);
}

// Bias and spread of the logarithms of the noise scales over many devices whose
// IMU is 30 times worse and whose rig states all noise 3 times too small.
void MeasureAccuracy(Context* context) {
  const NoiseFactorsDevice device = Devices(context->quick())[0];
  const Belief belief = {"all 3 times too small", AllKinds(), 1.0 / 3};
  const int count = context->quick() ? kQuickAccuracyDevices : kAccuracyDevices;
  std::vector<std::vector<NoiseScale>> found(count);
  context->ForEach(count, [&](int i) {
    SimulationOptions options = DatasetOptions(i);
    options.seed = kAccuracyFirstSeed + i;
    const Dataset dataset = MakeDataset(i % kDatasets,
                                        device.duration_s,
                                        WithNoise(device.inertial_factor),
                                        options);
    const Rig rig = Believe(dataset.rig, belief);
    found[i] = OverTruth(
        Calibrate(rig, rig.factory, dataset.segments()), rig, dataset.rig);
    context->Progress("accuracy, device " + std::to_string(i + 1));
  });
  ResultTable table({"kind",
                     "found over truth, geometric mean",
                     "standard error of its logarithm",
                     "spread of the logarithm",
                     "claimed sigma of the logarithm",
                     "within 10 %"});
  for (const NoiseKind kind : AllKinds()) {
    if (!IsWhite(kind)) continue;
    std::vector<double> logs, claimed;
    for (const std::vector<NoiseScale>& scales : found) {
      logs.push_back(std::log(scales.at(IndexOf(kind)).factor));
      claimed.push_back(scales.at(IndexOf(kind)).log_sigma);
    }
    const double spread = StandardDeviation(logs);
    table.Add({NoiseKindName(kind),
               std::exp(Mean(logs)),
               spread / std::sqrt(count),
               spread,
               Rms(claimed),
               std::to_string(std::count_if(
                   logs.begin(),
                   logs.end(),
                   [](double x) { return std::abs(std::exp(x) - 1) <= 0.1; })) +
                   " of " + std::to_string(count)});
    const std::string name = "noise_factors.accuracy_" + NoiseKindName(kind);
    context->Within(name + "_mean", std::exp(Mean(logs)), 0.9, 1.1);
    context->AtMost(
        name + "_spread_over_claimed",
        spread / Rms(claimed),
        std::sqrt(ChiSquareQuantile(0.5 + kSpreadProbability / 2, count - 1) /
                  (count - 1)));
  }
  context->WriteTable("accuracy", table);
}

// Of the processor, on one thread: what else it does does not count.
double Seconds(const Dataset& dataset, const CalibrateOptions& options) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    const std::clock_t begin = std::clock();
    Calibrate(dataset.rig, dataset.rig.factory, dataset.segments(), options);
    const double passed = static_cast<double>(std::clock() - begin);
    least = std::min(least, passed / CLOCKS_PER_SEC);
  }
  return least;
}

void MeasureCost(Context* context) {
  ResultTable table({"segments",
                     "calibration without [s]",
                     "with the factors [s]",
                     "factors over calibration"});
  double most = 0;
  for (const double duration_s :
       context->quick() ? std::vector{8.5} : std::vector{24.5, 64.5}) {
    const Dataset dataset = MakeDataset(0, duration_s);
    const double without = Seconds(dataset, {.noise_scales = false});
    const double with = Seconds(dataset, {});
    const double cost = with / without - 1;
    most = std::max(most, cost);
    table.Add(
        {static_cast<int>(dataset.segments().size()), without, with, cost});
    context->Progress("cost, " + std::to_string(dataset.segments().size()) +
                      " segments");
  }
  context->WriteTable("cost", table);
  context->AtMost("noise_factors.cost_over_a_calibration", most, 1);
}

}  // namespace

void RunNoiseFactors(Context* context) {
  MeasureCost(context);
  FindFactors(context);
  MeasureAccuracy(context);
}

}  // namespace selfcal
