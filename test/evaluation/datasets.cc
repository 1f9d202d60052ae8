#include "test/evaluation/datasets.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "test/recordings.h"

namespace selfcal {
namespace {

constexpr std::array<const char*, 5> kRecorded = {
    "tumvi_corridor1_handheld",
    "udel_gore_handheld",
    "tumvi_room1_handheld",
    "rpng_table_01_handheld",
    "euroc_v2_01_mav",
};
constexpr int kAnalytic = kDatasets - static_cast<int>(kRecorded.size());

// A wrong factory calibration that is nobody's lucky draw.
constexpr std::uint64_t kFactorySeed = 4;

// The first duration_s of a motion.
class FirstPart : public Trajectory {
 public:
  FirstPart(std::unique_ptr<Trajectory> whole, double duration_s)
      : whole_(std::move(whole)),
        duration_s_(std::min(duration_s, whole_->duration_s())) {}
  double duration_s() const override { return duration_s_; }
  BodyMotion At(double t_s) const override { return whole_->At(t_s); }

 private:
  const std::unique_ptr<Trajectory> whole_;
  const double duration_s_;
};

std::unique_ptr<Trajectory> ReadTrajectory(const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  std::vector<TimedPose> poses;
  std::string error;
  std::unique_ptr<Trajectory> trajectory;
  if (ParseTum(text.str(), &poses, &error)) {
    trajectory = MakeSpline(poses, {}, &error);
  }
  if (!trajectory) throw std::runtime_error(path + ": " + error);
  return trajectory;
}

std::uint64_t MotionSeed(int dataset) {
  return 100 + static_cast<std::uint64_t>(dataset);
}

}  // namespace

EvaluatedDevice MakeDevice() {
  EvaluatedDevice device;
  device.rig = HandheldRig("evaluated");
  device.truth = device.rig.factory;
  device.rig.factory = PerturbCalibration(device.truth, {}, kFactorySeed);
  return device;
}

Motion MakeMotion(int dataset, double duration_s) {
  const std::string analytic = "mixed-" + std::to_string(dataset + 1);
  if (dataset < kAnalytic) {
    return {analytic, false, MakeMixed(duration_s, MotionSeed(dataset))};
  }
  const std::string name = kRecorded.at(dataset - kAnalytic);
  const std::string path = Recording("trajectories/" + name + ".tum");
  if (path.empty()) {
    return {analytic + "-for-" + name,
            false,
            MakeMixed(duration_s, MotionSeed(dataset))};
  }
  return {name,
          true,
          std::make_unique<FirstPart>(ReadTrajectory(path), duration_s)};
}

SimulationOptions DatasetOptions(int dataset) {
  SimulationOptions options;
  options.seed = 1000 + static_cast<std::uint64_t>(dataset);
  options.revisit_fraction = 0;
  return options;
}

Dataset MakeDataset(int dataset,
                    double duration_s,
                    const EvaluatedDevice& device,
                    const SimulationOptions& options) {
  const Motion motion = MakeMotion(dataset, duration_s);
  Dataset result;
  result.name = motion.name;
  result.recorded = motion.recorded;
  result.duration_s = motion.trajectory->duration_s();
  result.rig = device.rig;
  result.truth = device.truth;
  result.session = Simulate(device.rig,
                            device.truth,
                            device.rig.factory,
                            *motion.trajectory,
                            motion.name,
                            options);
  return result;
}

Dataset MakeDataset(int dataset, double duration_s) {
  return MakeDataset(
      dataset, duration_s, MakeDevice(), DatasetOptions(dataset));
}

}  // namespace selfcal
