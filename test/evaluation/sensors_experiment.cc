// One, two and four cameras, whose clocks are off from that of the IMU: with
// the time offsets known, estimated, and ignored.
#include <Eigen/Cholesky>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/calibration/calibrate.h"
#include "test/core/simulation/rigs.h"
#include "test/evaluation/context.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

// Of the cameras in truth; the factory believes in none where they are not
// known.
constexpr double kTimeOffsets_s[] = {0.02, -0.015, 0.008, -0.003};

enum class Offsets { kKnown, kEstimated, kIgnored };

struct Setting {
  int cameras;
  Offsets offsets;

  std::string Name() const {
    static const char* const kNames[] = {"known", "estimated", "ignored"};
    return std::to_string(cameras) + "_" + kNames[static_cast<int>(offsets)];
  }
};

// A device whose factory calibration is off.
struct Device {
  Rig rig;
  Calibration truth;
};

Device DeviceOf(const Setting& setting, std::uint64_t seed) {
  Device device{RigOfCameras(setting.cameras), {}};
  device.truth = device.rig.factory;
  for (int j = 0; j < setting.cameras; ++j) {
    device.truth.cameras[j].time_offset_s = kTimeOffsets_s[j];
  }
  device.rig.factory = PerturbCalibration(
      setting.offsets == Offsets::kKnown ? device.truth : device.rig.factory,
      {},
      seed);
  device.rig.blocks = {
      {"*.time_offset", setting.offsets == Offsets::kEstimated}};
  device.rig.groups = DefaultGroups(device.rig.blocks);
  return device;
}

// Errors and claimed sigmas of one calibration, of all components; sigma 0
// where nothing is estimated.
struct Run {
  Eigen::VectorXd error, sigma;
  double nees = 0;
  int degrees = 0;
};

Run RunOne(const Setting& setting, std::uint64_t seed, double duration_s) {
  const Device device = DeviceOf(setting, seed);
  SimulationOptions options;
  options.seed = seed;
  options.landmarks_in_view = 60;
  const SimulatedSession session = Simulate(device.rig,
                                            device.truth,
                                            device.rig.factory,
                                            *MakeHandheld(duration_s, 1, seed),
                                            "session",
                                            options);
  const CalibrationResult result = Calibrate(
      device.rig, device.rig.factory, session.segments, ComparedOptions());
  if (result.status != CalibrateStatus::kConverged &&
      setting.offsets != Offsets::kIgnored) {
    throw std::runtime_error(setting.Name() + ", seed " + std::to_string(seed) +
                             ": " + result.message);
  }
  Run run;
  run.error = BoxMinus(result.theta, device.truth);
  run.sigma = result.covariance.diagonal().cwiseSqrt();
  const SquaredError square =
      NormalisedSquaredError(run.error, result.covariance);
  run.nees = square.nees;
  run.degrees = square.dof;
  return run;
}

// Over all runs, of the components that match a pattern.
struct Accuracy {
  double error_rms = 0;
  double sigma_rms = 0;
};

Accuracy AccuracyOf(const std::vector<Run>& runs,
                    const std::vector<int>& components) {
  std::vector<double> errors, sigmas;
  for (const Run& run : runs) {
    for (const int i : components) {
      errors.push_back(run.error(i));
      sigmas.push_back(run.sigma(i));
    }
  }
  return {Rms(errors), Rms(sigmas)};
}

// |error| / sigma of all runs and of the estimated ones of the components.
std::vector<double> Normalised(const std::vector<Run>& runs,
                               const std::vector<int>& components) {
  std::vector<double> normalised;
  for (const Run& run : runs) {
    for (const int i : components) {
      if (run.sigma(i) > 0) {
        normalised.push_back(std::abs(run.error(i)) / run.sigma(i));
      }
    }
  }
  return normalised;
}

double PartBelow(const std::vector<double>& values, double limit) {
  double count = 0;
  for (const double value : values) count += value <= limit;
  return count / static_cast<double>(values.size());
}

double MeanNees(const std::vector<Run>& runs) {
  double sum = 0;
  for (const Run& run : runs) sum += run.nees;
  return sum / static_cast<double>(runs.size());
}

struct Block {
  const char* name;
  const char* pattern;
  double unit;  // of the table in units of the tangent
};
constexpr Block kBlocks[] = {
    {"time offset [ms]", "*.time_offset", 1e-3},
    {"q_CI [mrad]", "*.q_CI.*", 1e-3},
    {"p_CI [mm]", "*.p_CI.*", 1e-3},
    {"f [px]", "*.focal.*", 1},
    {"c [px]", "*.principal.*", 1},
    {"s_g [1e-3]", "imu.gyro.scale.*", 1e-3},
    {"s_a [1e-3]", "imu.accel.scale.*", 1e-3},
};

ResultTable ConsistencyTable() {
  return ResultTable({"cameras and offsets",
                      "estimated",
                      "runs",
                      "mean NEES",
                      "95 % from",
                      "to",
                      "within 1 sigma",
                      "2 sigma",
                      "3 sigma"});
}

void AddConsistency(const Setting& setting,
                    const std::vector<Run>& runs,
                    ResultTable* table) {
  std::vector<int> all(runs.front().error.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const std::vector<double> normalised = Normalised(runs, all);
  const auto [low, high] =
      NeesBounds(runs.front().degrees, static_cast<int>(runs.size()), 0.95);
  table->Add({setting.Name(),
              static_cast<long>(runs.front().degrees),
              static_cast<long>(runs.size()),
              MeanNees(runs),
              low,
              high,
              PartBelow(normalised, 1),
              PartBelow(normalised, 2),
              PartBelow(normalised, 3)});
}

void AddAccuracy(const Setting& setting,
                 const std::vector<Run>& runs,
                 ResultTable* table) {
  const auto components =
      TangentComponents(RigOfCameras(setting.cameras).factory);
  std::vector<Cell> row = {setting.Name()};
  for (const Block& block : kBlocks) {
    const Accuracy accuracy =
        AccuracyOf(runs, MatchComponents(components, {block.pattern}));
    row.emplace_back(accuracy.error_rms / block.unit);
    row.emplace_back(accuracy.sigma_rms / block.unit);
  }
  table->Add(std::move(row));
}

ResultTable AccuracyTable() {
  std::vector<std::string> columns = {"cameras and offsets"};
  for (const Block& block : kBlocks) {
    columns.push_back(std::string(block.name) + " rms error");
    columns.push_back("claimed");
  }
  return ResultTable(columns);
}

}  // namespace

void RunSensors(Context* context) {
  const int runs = context->quick() ? 2 : 25;
  const double duration_s = context->quick() ? 8.5 : 24.5;
  ResultTable consistency = ConsistencyTable();
  ResultTable accuracy = AccuracyTable();
  std::vector<double> offsets;
  for (const int cameras : {1, 2, 4}) {
    for (const Offsets kind :
         {Offsets::kKnown, Offsets::kEstimated, Offsets::kIgnored}) {
      const Setting setting{cameras, kind};
      std::vector<Run> all(runs);
      context->ForEach(runs, [&](int i) {
        all[i] = RunOne(
            setting, static_cast<std::uint64_t>(100 * cameras + i), duration_s);
      });
      context->Progress(setting.Name());
      AddConsistency(setting, all, &consistency);
      AddAccuracy(setting, all, &accuracy);
      if (kind == Offsets::kIgnored) continue;
      const auto [low, high] = NeesBounds(all.front().degrees, runs, 0.95);
      context->Within(
          "sensors.nees_" + setting.Name(), MeanNees(all), low, high);
      if (kind != Offsets::kEstimated) continue;
      const auto components = TangentComponents(RigOfCameras(cameras).factory);
      const std::vector<double> some =
          Normalised(all, MatchComponents(components, {"*.time_offset"}));
      offsets.insert(offsets.end(), some.begin(), some.end());
    }
  }
  context->WriteTable("consistency", consistency);
  context->WriteTable("accuracy", accuracy);
  context->AtLeast("sensors.time_offset_within_3_sigma",
                   PartBelow(offsets, 3),
                   0.98,
                   {.robust = true});
  context->Within("sensors.time_offset_rms_in_sigmas", Rms(offsets), 0.8, 1.2);
}

}  // namespace selfcal
