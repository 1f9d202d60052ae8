#include "test/evaluation/trust_simulation.h"

#include <utility>

namespace selfcal {
namespace {

// Seeds of the truth, apart from those of the factory.
constexpr std::uint64_t kTruthSeed = 1'000'000;

}  // namespace

TrustDevice MakeTrustDevice(std::uint64_t seed, int table_size) {
  TrustDevice device;
  device.rig = HandheldRig("device");
  device.truth = PerturbCalibration(device.rig.factory, {}, kTruthSeed + seed);
  device.rig.factory = PerturbCalibration(*device.truth, {}, seed);
  device.rig.table_size = table_size;
  device.sensors = device.rig;
  return device;
}

SimulationOptions TrustOptions(std::uint64_t seed) {
  SimulationOptions options;
  options.seed = seed;
  options.landmarks_in_view = 60;
  options.revisit_fraction = 0;
  return options;
}

void AddSession(std::shared_ptr<const Trajectory> motion,
                const std::string& name,
                const SimulationOptions& options,
                TrustDevice* device,
                SessionEdit edit) {
  device->sessions.push_back(
      [sensors = device->sensors,
       truth = device->truth.value(),
       motion = std::move(motion),
       name,
       options,
       edit = std::move(edit)](const Calibration& theta_slam) {
        SimulatedSession session =
            Simulate(sensors, truth, theta_slam, *motion, name, options);
        if (edit) edit(theta_slam, &session);
        return TrustSession{std::move(session.segments), truth};
      });
}

}  // namespace selfcal
