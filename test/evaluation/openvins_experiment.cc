// The scenario of OpenVINS's simulator in that of the project, and what tables
// and batch come to on it beside the figures of OpenVINS's online calibration.
//
// Its sensors, noise, priors and starts (config rpng_sim and State.cpp of
// rpng/open_vins) on the trajectory udel_gore: one camera of 752 x 480 with
// radial-tangential distortion, 1 px, up to 250 tracks a frame at 10 Hz, IMU
// 400 Hz, 170 s in segments of 4 s; priors of 10 ms, 5 mrad, 15 mm, 1 px and
// 0.005. The states of the SLAM system are those of Simulate(), not of its
// filter.
//
// The same with a rolling shutter, which OpenVINS does not have: a readout of
// 20 ms whose line delay is estimated from zero; and batch alone with it, on
// more seeds, which tells whether its errors exceed its sigmas or chance does.
#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/model/so3.h"
#include "core/simulation/random.h"
#include "core/simulation/simulate.h"
#include "test/evaluation/context.h"
#include "test/evaluation/datasets.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/statistics.h"
#include "test/evaluation/trust_device.h"

namespace selfcal {
namespace {

constexpr int kGore = 11;  // of the datasets
constexpr double kDuration_s = 172.2;
constexpr int kSeeds = 6;
constexpr std::uint64_t kOpenVinsFirstSeed = 70'000;
constexpr int kBatchSeeds = 18;
constexpr std::uint64_t kBatchFirstSeed = 71'000;
constexpr std::uint64_t kStartStream = 401;
constexpr double kReadout_s = 0.02;

enum class Shutter { kGlobal, kRolling };

// One block of theta with the figures of OpenVINS for it: root mean square
// error of its online calibration on all of the data, and claimed sigma.
struct Block {
  std::string name;
  std::string unit;
  double scale;  // to that unit
  std::vector<std::string> patterns;
  double online_error, online_sigma;
  double tables_error, tables_sigma, batch_sigma;  // of selfcal before
};

const std::vector<Block>& Blocks() {
  static const std::vector<Block> blocks = {
      {"time offset", "us", 1e6, {"*.time_offset"}, 22, 16, 31, 22, 15},
      {"camera rotation", "mrad", 1e3, {"*.q_CI.*"}, .25, .28, .30, .36, .25},
      {"camera position", "mm", 1e3, {"*.p_CI.*"}, 1.6, 1.4, 1.7, 1.9, 1.2},
      {"f and c",
       "px",
       1,
       {"*.focal.*", "*.principal.*"},
       .12,
       .11,
       .13,
       .13,
       .09},
      {"distortion", "1e-3", 1e3, {"*.distortion.*"}, .13, .10, .12, .12, .08},
      {"gyroscope", "1e-3", 1e3, {"imu.gyro.*"}, .29, .35, .38, .44, .31},
      {"accelerometer", "1e-3", 1e3, {"imu.accel.*"}, 1.3, 1.4, 2.1, 2.2, 1.4},
      {"R_AI", "mrad", 1e3, {"imu.q_AI.*"}, 1.1, 1.3, 1.9, 2.1, 1.3}};
  return blocks;
}

Rig TrueRig(Shutter shutter) {
  Rig rig = HandheldRig("openvins");
  rig.factory.imu = ImuCalibration();
  CameraCalibration& camera = rig.factory.cameras[0];
  Eigen::Matrix3d R_IC;
  R_IC << 0.0148655429818, -0.999880929698, 0.00414029679422, 0.999557249008,
      0.0149672133247, 0.025715529948, -0.0257744366974, 0.00375618835797,
      0.999660727178;
  const Eigen::Vector3d p_IC(
      -0.0216401454975, -0.064676986768, 0.00981073058949);
  camera.q_CI = Eigen::Quaterniond(R_IC).conjugate().normalized();
  camera.p_CI = -(camera.q_CI * p_IC);
  camera.f = {458.654, 457.296};
  camera.c = {367.215, 248.375};
  camera.model = DistortionModel::kRadialTangential;
  camera.distortion =
      Eigen::Vector4d(-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05);
  camera.width_px = 752;
  camera.height_px = 480;
  if (shutter == Shutter::kRolling) {
    camera.line_delay_s = kReadout_s / camera.height_px;
  }
  rig.imu_noise.gyro_noise_density = 1.6968e-4;
  rig.imu_noise.accel_noise_density = 2e-3;
  rig.imu_noise.gyro_bias_random_walk = 1.9393e-5;
  rig.imu_noise.accel_bias_random_walk = 3e-3;
  rig.pixel_sigma_px = 1;
  rig.blocks = {{"*.time_offset", true}};
  rig.groups = DefaultGroups(rig.blocks, rig.factory);
  rig.prior_sigmas = {{"imu.gyro.*", 5e-3},
                      {"imu.accel.*", 8e-3},
                      {"imu.q_AI.*", 5e-3},
                      {"*.q_CI.*", 5e-3},
                      {"*.p_CI.*", 1.5e-2},
                      {"*.focal.*", 1},
                      {"*.principal.*", 1},
                      {"*.distortion.*", 5e-3},
                      {"*.time_offset", 1e-2}};
  return rig;
}

// The standard deviations of where OpenVINS starts from; a line delay starts at
// zero.
Calibration DrawStart(const Calibration& truth, std::uint64_t seed) {
  Random random(seed, kStartStream);
  const auto components = TangentComponents(truth);
  Eigen::VectorXd error(static_cast<Eigen::Index>(components.size()));
  for (std::size_t i = 0; i < components.size(); ++i) {
    const std::string& name = components[i].name;
    const auto has = [&](const char* part) {
      return name.find(part) != std::string::npos;
    };
    double sigma = 1;  // focal length and principal point [px]
    if (has("imu.gyro") || has("imu.accel")) sigma = 4e-3;
    if (has("q_AI")) sigma = 2e-3;
    if (has("q_CI")) sigma = 1e-3;
    if (has("p_CI")) sigma = 1e-2;
    if (has("distortion")) sigma = 5e-3;
    if (has("time_offset")) sigma = 1e-2;
    error(static_cast<Eigen::Index>(i)) = sigma * random.Normal();
  }
  Calibration start = BoxPlus(truth, error);
  for (CameraCalibration& camera : start.cameras) {
    if (camera.line_delay_s) camera.line_delay_s = 0;
  }
  return start;
}

// One estimate of one seed.
struct Estimated {
  Eigen::VectorXd error, sigma;
  double nees = 0;
  int degrees = 0;
  int segments = 0;
  double seconds = 0;
};

Estimated Assess(const Rig& rig,
                 const Calibration& truth,
                 const Calibration& theta,
                 const Eigen::MatrixXd& covariance) {
  const TrustError error = ErrorAgainst(rig, truth, theta, covariance);
  Estimated estimated;
  estimated.error = BoxMinus(theta, truth);
  estimated.sigma = covariance.diagonal().cwiseSqrt();
  estimated.nees = error.nees;
  estimated.degrees = error.degrees;
  return estimated;
}

struct Seed {
  Rig rig;
  Estimated tables, batch;
  int sent = 0;
};

// The device has one session, which does not depend on the active calibration.
TrustDevice SimulateDevice(Shutter shutter,
                           std::uint64_t seed,
                           double duration_s) {
  TrustDevice device;
  device.rig = TrueRig(shutter);
  device.truth = device.rig.factory;
  device.sensors = device.rig;
  device.rig.factory = DrawStart(*device.truth, seed);
  SimulationOptions options;
  options.seed = seed;
  options.imu_rate_hz = 400;
  options.landmarks_in_view = 250;
  options.mean_track_length = 20;
  options.revisit_fraction = 0;
  options.min_depth_m = 3;
  options.max_depth_m = 8;
  const Motion motion = MakeMotion(kGore, duration_s);
  const auto session =
      std::make_shared<const SimulatedSession>(Simulate(device.sensors,
                                                        *device.truth,
                                                        device.rig.factory,
                                                        *motion.trajectory,
                                                        motion.name,
                                                        options));
  device.sessions.push_back([session](const Calibration&) {
    return TrustSession{session->segments, {}};
  });
  return device;
}

Estimated RunBatch(const TrustDevice& device) {
  const std::vector<MotionSegment> segments =
      device.sessions.front()(device.rig.factory).segments;
  const CalibrationResult batch = CalibrateOn(
      device.rig, segments, AllSegments(static_cast<int>(segments.size())));
  Estimated estimated =
      Assess(device.rig, *device.truth, batch.theta, batch.covariance);
  estimated.segments = batch.segments;
  return estimated;
}

Seed RunSeed(Shutter shutter, std::uint64_t seed, double duration_s) {
  const TrustDevice device = SimulateDevice(shutter, seed, duration_s);
  Seed result{device.rig, {}, {}};
  const TrustOutcome driven = Drive(device);
  if (driven.final_version == 1) {
    throw std::runtime_error(
        fmt::format("seed {}: no version became active", seed));
  }
  result.sent = driven.segments;
  result.tables = Assess(
      device.rig, *device.truth, driven.final_theta, driven.final_covariance);
  result.tables.seconds = driven.pipeline_seconds;
  for (const TrustVersion& version : driven.versions) {
    if (version.stored.version == driven.final_version) {
      result.tables.segments = static_cast<int>(version.stored.segments.size());
    }
  }
  result.batch = RunBatch(device);
  return result;
}

// Root mean square over seeds and the components of a block, in its unit.
double BlockRms(const std::vector<Seed>& seeds,
                const Block& block,
                Estimated Seed::*estimator,
                Eigen::VectorXd Estimated::*of) {
  std::vector<double> values;
  for (const Seed& seed : seeds) {
    const auto components = TangentComponents(seed.rig.factory);
    for (const int i : MatchComponents(components, block.patterns)) {
      values.push_back(block.scale * ((seed.*estimator).*of)(i));
    }
  }
  return Rms(values);
}

void ReportBlocks(const std::vector<Seed>& seeds, Context* context) {
  ResultTable table({"block",
                     "unit",
                     "tables: error",
                     "sigma",
                     "batch: error",
                     "sigma of it",
                     "OpenVINS online: error",
                     "sigma claimed",
                     "selfcal on its simulator: error",
                     "sigma there",
                     "sigma of batch there"});
  std::vector<double> by_batch, by_online;
  for (const Block& block : Blocks()) {
    const auto rms = [&](auto estimator, auto of) {
      return BlockRms(seeds, block, estimator, of);
    };
    const double sigma = rms(&Seed::tables, &Estimated::sigma);
    const double batch_sigma = rms(&Seed::batch, &Estimated::sigma);
    table.Add({block.name,
               block.unit,
               rms(&Seed::tables, &Estimated::error),
               sigma,
               rms(&Seed::batch, &Estimated::error),
               batch_sigma,
               block.online_error,
               block.online_sigma,
               block.tables_error,
               block.tables_sigma,
               block.batch_sigma});
    by_batch.push_back(sigma / batch_sigma);
    by_online.push_back(sigma / block.online_sigma);
  }
  context->WriteTable("blocks", table);
  context->AtMost("openvins_scenario.sigma_by_batch_max",
                  *std::max_element(by_batch.begin(), by_batch.end()),
                  1.1);
  context->AtMost("openvins_scenario.sigma_by_online_max",
                  *std::max_element(by_online.begin(), by_online.end()),
                  1.0);
}

void ReportRollingBlocks(const std::vector<Seed>& seeds, Context* context) {
  std::vector<Block> blocks = Blocks();
  blocks.push_back({"line delay", "us", 1e6, {"*.line_delay"}, 0, 0, 0, 0, 0});
  ResultTable table({"block",
                     "unit",
                     "tables: error",
                     "sigma",
                     "batch: error",
                     "sigma of it"});
  for (const Block& block : blocks) {
    const auto rms = [&](auto estimator, auto of) {
      return BlockRms(seeds, block, estimator, of);
    };
    table.Add({block.name,
               block.unit,
               rms(&Seed::tables, &Estimated::error),
               rms(&Seed::tables, &Estimated::sigma),
               rms(&Seed::batch, &Estimated::error),
               rms(&Seed::batch, &Estimated::sigma)});
  }
  context->WriteTable("blocks", table);
}

void ReportSeeds(const std::string& experiment,
                 const std::vector<Seed>& seeds,
                 Context* context) {
  ResultTable table({"seed",
                     "segments sent",
                     "kept",
                     "NEES of tables",
                     "NEES of batch",
                     "degrees",
                     "pipeline [s]"});
  int outside = 0;
  double kept = 0, nees = 0, nees_batch = 0;
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    const Seed& seed = seeds[i];
    table.Add({static_cast<long>(kOpenVinsFirstSeed + i),
               static_cast<long>(seed.sent),
               static_cast<long>(seed.tables.segments),
               seed.tables.nees,
               seed.batch.nees,
               static_cast<long>(seed.tables.degrees),
               seed.tables.seconds});
    const auto [low, high] = NeesBounds(seed.tables.degrees, 1, 0.99);
    outside += seed.tables.nees > high;
    kept += static_cast<double>(seed.tables.segments) / seed.sent;
    nees += seed.tables.nees;
    nees_batch += seed.batch.nees;
  }
  context->WriteTable("seeds", table);
  const auto count = static_cast<double>(seeds.size());
  const double bound =
      NeesBounds(
          seeds.front().tables.degrees, static_cast<int>(seeds.size()), 0.95)
          .second;
  context->AtMost(experiment + ".nees_mean", nees / count, bound);
  context->AtMost(experiment + ".batch_nees_mean", nees_batch / count, bound);
  context->AtMost(experiment + ".nees_outside", outside, 0);
  context->AtMost(experiment + ".segments_kept", kept / count, 0.4);
}

double Duration(bool quick) { return quick ? 60 : kDuration_s; }

std::vector<Seed> RunSeeds(Shutter shutter, Context* context) {
  const int count = context->quick() ? 1 : kSeeds;
  const double duration_s = Duration(context->quick());
  std::vector<Seed> seeds(static_cast<std::size_t>(count));
  context->ForEach(count, [&](int i) {
    const std::uint64_t seed =
        kOpenVinsFirstSeed + static_cast<std::uint64_t>(i);
    seeds[i] = RunSeed(shutter, seed, duration_s);
    context->Progress(fmt::format("seed {}: NEES {:.1f}, batch {:.1f}",
                                  seed,
                                  seeds[i].tables.nees,
                                  seeds[i].batch.nees));
  });
  return seeds;
}

}  // namespace

void RunOpenVinsScenario(Context* context) {
  const std::vector<Seed> seeds = RunSeeds(Shutter::kGlobal, context);
  ReportBlocks(seeds, context);
  ReportSeeds("openvins_scenario", seeds, context);
}

void RunOpenVinsRolling(Context* context) {
  const std::vector<Seed> seeds = RunSeeds(Shutter::kRolling, context);
  ReportRollingBlocks(seeds, context);
  ReportSeeds("openvins_rolling", seeds, context);
}

void RunOpenVinsRollingBatch(Context* context) {
  const int count = context->quick() ? 1 : kBatchSeeds;
  std::vector<Estimated> batches(static_cast<std::size_t>(count));
  context->ForEach(count, [&](int i) {
    const std::uint64_t seed = kBatchFirstSeed + static_cast<std::uint64_t>(i);
    batches[i] = RunBatch(
        SimulateDevice(Shutter::kRolling, seed, Duration(context->quick())));
    context->Progress(
        fmt::format("seed {}: NEES {:.1f}", seed, batches[i].nees));
  });
  ResultTable table({"seed", "NEES", "degrees"});
  std::vector<double> nees;
  for (int i = 0; i < count; ++i) {
    table.Add({static_cast<long>(kBatchFirstSeed) + i,
               batches[i].nees,
               static_cast<long>(batches[i].degrees)});
    nees.push_back(batches[i].nees);
  }
  context->WriteTable("seeds", table);
  const auto [low, high] = NeesBounds(batches.front().degrees, count, 0.95);
  context->Within("openvins_rolling_batch.nees_mean", Mean(nees), low, high);
}

}  // namespace selfcal
