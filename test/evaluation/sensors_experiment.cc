// Models of sensors: one, two and four cameras, whose clocks are off from that
// of the IMU, or drift; rolling shutters; a camera of each model; gyroscopes
// that react to acceleration; accelerometers whose axes lie apart; a second
// IMU; a device that warms up. What a model adds is known, estimated, and
// ignored.
#include <Eigen/Cholesky>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/model/camera_model.h"
#include "core/model/temperature.h"
#include "test/core/simulation/rigs.h"
#include "test/evaluation/context.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

// Of the cameras in truth; the factory believes in none where they are not
// known.
constexpr double kTimeOffsets_s[] = {0.02, -0.015, 0.008, -0.003};
constexpr int kReadouts_ms[] = {10, 20, 33};

enum class Effect { kKnown, kEstimated, kIgnored };
constexpr Effect kEffects[] = {
    Effect::kKnown, Effect::kEstimated, Effect::kIgnored};

std::string EffectName(Effect effect) {
  static const char* const kNames[] = {"known", "estimated", "ignored"};
  return kNames[static_cast<int>(effect)];
}

struct Setting {
  std::string name;
  std::uint64_t seed;  // of its first run
  // Its factory calibration is perturbed for each run.
  Rig rig;
  Calibration truth;
  bool ignored = false;
  double apart_s = 0;  // from one segment to the next; 0: of one motion
  // Temperature of each segment [deg C]; empty: one motion, of none.
  std::vector<double> temperatures_c = {};
};

Setting OffsetSetting(int cameras, Effect effect) {
  Setting setting;
  setting.name = std::to_string(cameras) + "_" + EffectName(effect);
  setting.seed = 100 * cameras;
  setting.rig = RigOfCameras(cameras);
  setting.truth = setting.rig.factory;
  for (int j = 0; j < cameras; ++j) {
    setting.truth.cameras[j].time_offset_s = kTimeOffsets_s[j];
  }
  if (effect == Effect::kKnown) setting.rig.factory = setting.truth;
  setting.rig.blocks = {{"*.time_offset", effect == Effect::kEstimated}};
  setting.ignored = effect == Effect::kIgnored;
  return setting;
}

Setting RollingSetting(int readout_ms, Effect effect) {
  Setting setting;
  setting.name =
      "rolling_" + std::to_string(readout_ms) + "ms_" + EffectName(effect);
  setting.seed = 1000;
  setting.rig = RigOfCameras(1);
  setting.truth = setting.rig.factory;
  CameraCalibration& camera = setting.truth.cameras[0];
  camera.line_delay_s = 1e-3 * readout_ms / camera.height_px;
  if (effect == Effect::kKnown) {
    setting.rig.factory = setting.truth;
    setting.rig.blocks = {{"*.line_delay", false}};
  }
  if (effect == Effect::kEstimated) {
    setting.rig.factory.cameras[0].line_delay_s = 0;
  }
  setting.ignored = effect == Effect::kIgnored;
  return setting;
}

// A clock that drifts by 50 parts in a million, over six segments within eight
// minutes of a session, and an unknown time offset.
Setting DriftSetting(Effect effect) {
  Setting setting;
  setting.name = "drift_" + EffectName(effect);
  setting.seed = 5000;
  setting.apart_s = 100;
  setting.rig = RigOfCameras(1);
  setting.truth = setting.rig.factory;
  setting.truth.cameras[0].time_offset_s = 0.004;
  setting.truth.cameras[0].time_drift = 5e-5;
  setting.rig.blocks = {{"*.time_offset", true}};
  if (effect == Effect::kKnown) {
    setting.rig.factory = setting.truth;
    setting.rig.blocks.push_back({"*.time_drift", false});
  }
  if (effect == Effect::kEstimated) {
    setting.rig.factory.cameras[0].time_drift = 0;
  }
  setting.ignored = effect == Effect::kIgnored;
  return setting;
}

// Six segments from -10 to 60 degrees, of a device whose scales, focal lengths
// and rotation of the camera vary with temperature.
Setting TemperatureSetting(Effect effect) {
  Setting setting;
  setting.name = "temperature_" + EffectName(effect);
  setting.seed = 6000;
  setting.temperatures_c = {-10, 4, 18, 32, 46, 60};
  setting.rig = RigOfCameras(1);
  setting.truth = WithSlopes(setting.rig.factory);
  if (effect == Effect::kKnown) setting.rig.factory = setting.truth;
  if (effect == Effect::kEstimated) {
    setting.rig.factory = WithZeroSlopes(setting.rig.factory);
  }
  setting.rig.blocks = {{"*_slope", effect == Effect::kEstimated}};
  setting.ignored = effect == Effect::kIgnored;
  return setting;
}

// A block of an IMU with these nine values in truth.
Setting ImuSetting(const std::string& name,
                   std::uint64_t seed,
                   OptionalVector ImuCalibration::*block,
                   const OptionalVector& value,
                   const std::string& pattern,
                   Effect effect) {
  Setting setting;
  setting.name = name + "_" + EffectName(effect);
  setting.seed = seed;
  setting.rig = RigOfCameras(1);
  setting.truth = setting.rig.factory;
  setting.truth.imu.*block = value;
  OptionalVector& known = setting.rig.factory.imu.*block;
  if (effect == Effect::kKnown) known = value;
  if (effect == Effect::kEstimated) known.setZero(value.size());
  setting.rig.blocks = {{pattern, effect == Effect::kEstimated}};
  setting.ignored = effect == Effect::kIgnored;
  return setting;
}

// A poor gyroscope: 0.5 mrad/s for each m/s^2 on and across its axes.
Setting GSensitivitySetting(Effect effect) {
  OptionalVector T_s(9);
  T_s << 5e-4, -3e-4, 2e-4, 1e-4, -4e-4, 3e-4, -2e-4, 5e-4, 4e-4;
  return ImuSetting("g_sensitivity",
                    3000,
                    &ImuCalibration::gyro_g_sensitivity,
                    T_s,
                    "imu.gyro.g_sensitivity",
                    effect);
}

// The x axis of the accelerometer is in the origin, which it defines.
Setting AccelPositionSetting(Effect effect) {
  OptionalVector r(9);
  r << 0, 0, 0, 0.03, -0.02, 0.01, -0.01, 0.02, 0.03;
  Setting setting = ImuSetting("accel_position",
                               4000,
                               &ImuCalibration::accel_position,
                               r,
                               "imu.accel.position",
                               effect);
  setting.rig.fixed = {"imu.accel.position.x.*"};
  return setting;
}

// Ignoring a second IMU is consistent: its cost is a larger sigma. Its readings
// are 2 ms late.
Setting TwoImusSetting(Effect effect) {
  Setting setting;
  setting.name = "two_imus_" + EffectName(effect);
  setting.seed = 7000;
  setting.rig = HandheldRig("two_imus");
  AddSecondImu(&setting.rig);
  setting.truth = setting.rig.factory;
  setting.truth.imu1->time_offset_s = -2e-3;
  setting.rig.blocks = {{"imu1.time_offset", true}};
  if (effect == Effect::kKnown) {
    setting.rig.factory = setting.truth;
    setting.rig.blocks = {{"imu1.*", false}};
  }
  if (effect == Effect::kIgnored) setting.rig.factory.imu1.reset();
  return setting;
}

Setting LensSetting(DistortionModel model) {
  Setting setting;
  setting.name = "lens_" + std::string(DistortionName(model));
  setting.seed = 2000;
  setting.rig = LensRig(model);
  setting.truth = setting.rig.factory;
  return setting;
}

std::vector<Setting> Settings() {
  std::vector<Setting> settings;
  for (const int cameras : {1, 2, 4}) {
    for (const Effect effect : kEffects) {
      settings.push_back(OffsetSetting(cameras, effect));
    }
  }
  for (const int readout_ms : kReadouts_ms) {
    for (const Effect effect : kEffects) {
      settings.push_back(RollingSetting(readout_ms, effect));
    }
  }
  for (const Effect effect : kEffects) {
    settings.push_back(DriftSetting(effect));
    settings.push_back(TemperatureSetting(effect));
    settings.push_back(GSensitivitySetting(effect));
    settings.push_back(AccelPositionSetting(effect));
    settings.push_back(TwoImusSetting(effect));
  }
  for (const DistortionModel model : DistortionModels()) {
    settings.push_back(LensSetting(model));
  }
  return settings;
}

// Errors and claimed sigmas of one calibration, of all components; sigma 0
// where nothing is estimated.
struct SensorsRun {
  Eigen::VectorXd error, sigma;
  double nees = 0;
  // Directions that the data determines. In the others, if there are any, the
  // factory's error is far smaller than its tolerance.
  int degrees = 0;
  std::vector<std::string> held;  // the main part of each direction
};

std::vector<MotionSegment> SegmentsOf(const Setting& setting,
                                      const Rig& rig,
                                      double duration_s,
                                      const SimulationOptions& options) {
  if (setting.apart_s > 0) {
    return SimulateApart(rig, setting.truth, 6, setting.apart_s, options);
  }
  if (!setting.temperatures_c.empty()) {
    return SimulateAtTemperatures(
        rig, setting.truth, setting.temperatures_c, options);
  }
  return Simulate(rig,
                  setting.truth,
                  rig.factory,
                  *MakeHandheld(duration_s, 1, options.seed),
                  "session",
                  options)
      .segments;
}

// nullopt if it does not converge.
std::optional<SensorsRun> RunOne(const Setting& setting,
                                 std::uint64_t seed,
                                 double duration_s) {
  Rig rig = setting.rig;
  rig.factory = PerturbCalibration(rig.factory, {}, seed);
  if (!IsEstimated(rig.blocks, "imu1.q_JI")) {
    rig.factory.imu1 = setting.rig.factory.imu1;
  }
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  SimulationOptions options;
  options.seed = seed;
  options.landmarks_in_view = 60;
  const std::vector<MotionSegment> segments =
      SegmentsOf(setting, rig, duration_s, options);
  const CalibrationResult result =
      Calibrate(rig, rig.factory, segments, ComparedOptions());
  if (result.status != CalibrateStatus::kConverged && !setting.ignored) {
    return std::nullopt;
  }
  // An ignored block is not a component.
  Calibration truth = setting.truth;
  const ImuCalibration& imu = rig.factory.imu;
  truth.imu.gyro_g_sensitivity.conservativeResize(
      imu.gyro_g_sensitivity.size());
  truth.imu.accel_position.conservativeResize(imu.accel_position.size());
  if (!rig.factory.imu1) truth.imu1.reset();
  // The values of one that ignores slopes are compared at the reference.
  if (!HasSlopes(rig.factory)) {
    truth = AtTemperature(truth, truth.reference_temperature_c);
  }
  for (std::size_t j = 0; j < truth.cameras.size(); ++j) {
    if (!rig.factory.cameras[j].line_delay_s) {
      truth.cameras[j].line_delay_s.reset();
    }
    if (!rig.factory.cameras[j].time_drift) truth.cameras[j].time_drift.reset();
  }
  SensorsRun run;
  run.error = BoxMinus(result.theta, truth);
  run.sigma = result.covariance.diagonal().cwiseSqrt();
  run.nees = NormalisedSquaredError(run.error, result.covariance).nees;
  run.degrees = result.rank;
  for (const UnobservedDirection& direction : result.held_constant) {
    run.held.push_back(direction.parts.front().component);
  }
  return run;
}

// Over all runs, of the components that match a pattern.
struct Accuracy {
  double error_rms = 0;
  double sigma_rms = 0;
};

Accuracy AccuracyOf(const std::vector<SensorsRun>& runs,
                    const std::vector<int>& components) {
  std::vector<double> errors, sigmas;
  for (const SensorsRun& run : runs) {
    for (const int i : components) {
      errors.push_back(run.error(i));
      sigmas.push_back(run.sigma(i));
    }
  }
  return {Rms(errors), Rms(sigmas)};
}

// |error| / sigma of all runs and of the estimated ones of the components.
std::vector<double> Normalised(const std::vector<SensorsRun>& runs,
                               const std::vector<int>& components) {
  std::vector<double> normalised;
  for (const SensorsRun& run : runs) {
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

int MeanDegrees(const std::vector<SensorsRun>& runs) {
  double sum = 0;
  for (const SensorsRun& run : runs) sum += run.degrees;
  return static_cast<int>(std::lround(sum / static_cast<double>(runs.size())));
}

double MeanNees(const std::vector<SensorsRun>& runs) {
  double sum = 0;
  for (const SensorsRun& run : runs) sum += run.nees;
  return sum / static_cast<double>(runs.size());
}

struct Block {
  const char* name;
  const char* pattern;
  double unit;  // of the table in units of the tangent
};
constexpr Block kBlocks[] = {
    {"time offset [ms]", "*.time_offset", 1e-3},
    {"line delay [us]", "*.line_delay", 1e-6},
    {"drift [us/s]", "*.time_drift", 1e-6},
    {"q_CI [mrad]", "*.q_CI.*", 1e-3},
    {"p_CI [mm]", "*.p_CI.*", 1e-3},
    {"f [px]", "*.focal.*", 1},
    {"c [px]", "*.principal.*", 1},
    {"s_g [1e-3]", "imu.gyro.scale.*", 1e-3},
    {"s_a [1e-3]", "imu.accel.scale.*", 1e-3},
    {"T_s [1e-5 rad s/m]", "imu.gyro.g_sensitivity.*", 1e-5},
    {"r [mm]", "imu.accel.position.*", 1e-3},
    {"q_JI [mrad]", "imu1.q_JI.*", 1e-3},
    {"p_JI [mm]", "imu1.p_JI.*", 1e-3},
    {"s_g of imu1 [1e-3]", "imu1.gyro.scale.*", 1e-3},
    {"s_a of imu1 [1e-3]", "imu1.accel.scale.*", 1e-3},
    {"slope of s_g [1e-6/K]", "imu.gyro.scale_slope.*", 1e-6},
    {"slope of s_a [1e-6/K]", "imu.accel.scale_slope.*", 1e-6},
    {"slope of q_CI [urad/K]", "*.q_CI_slope.*", 1e-6},
    {"slope of f [mpx/K]", "*.focal_slope.*", 1e-3},
};

ResultTable ConsistencyTable() {
  return ResultTable({"case",
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
                    const std::vector<SensorsRun>& runs,
                    ResultTable* table) {
  std::vector<int> all(runs.front().error.size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const std::vector<double> normalised = Normalised(runs, all);
  const auto [low, high] =
      NeesBounds(MeanDegrees(runs), static_cast<int>(runs.size()), 0.95);
  table->Add({setting.name,
              static_cast<long>(MeanDegrees(runs)),
              static_cast<long>(runs.size()),
              MeanNees(runs),
              low,
              high,
              PartBelow(normalised, 1),
              PartBelow(normalised, 2),
              PartBelow(normalised, 3)});
}

void AddAccuracy(const Setting& setting,
                 const std::vector<SensorsRun>& runs,
                 ResultTable* table) {
  const auto components = TangentComponents(setting.rig.factory);
  std::vector<Cell> row = {setting.name};
  for (const Block& block : kBlocks) {
    const std::vector<int> some = MatchComponents(components, {block.pattern});
    if (some.empty()) {
      row.insert(row.end(), 2, Cell());
      continue;
    }
    const Accuracy accuracy = AccuracyOf(runs, some);
    row.emplace_back(accuracy.error_rms / block.unit);
    row.emplace_back(accuracy.sigma_rms / block.unit);
  }
  table->Add(std::move(row));
}

// The number of runs in which each direction was held constant.
void AddHeld(const Setting& setting,
             const std::vector<SensorsRun>& runs,
             ResultTable* table) {
  std::map<std::string, long> held;
  for (const SensorsRun& run : runs) {
    for (const std::string& name :
         std::set<std::string>(run.held.begin(), run.held.end())) {
      ++held[name];
    }
  }
  const auto count = static_cast<long>(runs.size());
  if (held.empty()) table->Add({setting.name, count, "nothing", {}});
  for (const auto& [name, times] : held) {
    table->Add({setting.name, count, name, times});
  }
}

ResultTable AccuracyTable() {
  std::vector<std::string> columns = {"case"};
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
  ResultTable held({"case", "runs", "held", "in runs"});
  std::vector<double> offsets, line_delays;
  for (const Setting& setting : Settings()) {
    std::vector<std::optional<SensorsRun>> tried(runs);
    context->ForEach(runs, [&](int i) {
      tried[i] = RunOne(setting, setting.seed + i, duration_s);
    });
    context->Progress(setting.name);
    std::vector<SensorsRun> all;
    for (const std::optional<SensorsRun>& run : tried) {
      if (run) all.push_back(*run);
    }
    context->AtMost("sensors.not_converged_" + setting.name,
                    static_cast<double>(tried.size() - all.size()),
                    0);
    if (all.empty()) continue;
    AddConsistency(setting, all, &consistency);
    AddAccuracy(setting, all, &accuracy);
    AddHeld(setting, all, &held);
    if (setting.ignored) continue;
    const auto [low, high] =
        NeesBounds(MeanDegrees(all), static_cast<int>(all.size()), 0.95);
    context->Within("sensors.nees_" + setting.name, MeanNees(all), low, high);
    const auto collect = [&](const char* pattern, std::vector<double>* to) {
      const std::vector<double> some = Normalised(
          all,
          MatchComponents(TangentComponents(setting.rig.factory), {pattern}));
      to->insert(to->end(), some.begin(), some.end());
    };
    collect("*.time_offset", &offsets);
    collect("*.line_delay", &line_delays);
  }
  context->WriteTable("consistency", consistency);
  context->WriteTable("accuracy", accuracy);
  context->WriteTable("held", held);
  context->AtLeast("sensors.time_offset_within_3_sigma",
                   PartBelow(offsets, 3),
                   0.98,
                   {.robust = true});
  context->Within("sensors.time_offset_rms_in_sigmas", Rms(offsets), 0.8, 1.2);
  context->AtLeast("sensors.line_delay_within_3_sigma",
                   PartBelow(line_delays, 3),
                   0.98,
                   {.robust = true});
  context->Within(
      "sensors.line_delay_rms_in_sigmas", Rms(line_delays), 0.8, 1.2);
}

}  // namespace selfcal
