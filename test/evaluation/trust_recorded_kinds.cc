// Devices on recorded motion, and real recordings as they come.
#include <fmt/format.h>

#include <utility>

#include "test/evaluation/datasets.h"
#include "test/evaluation/recordings.h"
#include "test/evaluation/trust_kinds.h"
#include "test/evaluation/trust_simulation.h"

namespace selfcal {
namespace {

constexpr int kFirstRecorded = 10;  // of the datasets, as MakeMotion() has them
constexpr double kRecorded_s = 1.5 * kTrustSession_s;

std::optional<TrustDevice> OnRecordedMotion(std::uint64_t seed) {
  const int dataset =
      kFirstRecorded + static_cast<int>(seed % (kDatasets - kFirstRecorded));
  Motion motion = MakeMotion(dataset, kRecorded_s);
  if (!motion.recorded) return std::nullopt;
  TrustDevice device = MakeTrustDevice(seed);
  AddSession(
      std::move(motion.trajectory), motion.name, TrustOptions(seed), &device);
  return device;
}

// With the calibration that was published as factory's and, where it is that
// of a laboratory, as truth.
std::optional<TrustDevice> AsItComes(std::optional<RecordedDevice> recording,
                                     bool published) {
  if (!recording) return std::nullopt;
  TrustDevice device;
  device.rig = recording->rig;
  device.sensors = device.rig;
  if (published) device.truth = device.rig.factory;
  device.sessions.push_back(
      [segments = std::move(recording->segments)](const Calibration&) {
        return TrustSession{segments, {}};
      });
  return device;
}

}  // namespace

std::vector<TrustKind> RecordedKinds() {
  std::vector<TrustKind> kinds = {
      {"recorded_motion",
       "simulated sensors on the motion of five real devices, 90 s",
       60'000,
       15,
       0,
       OnRecordedMotion},
      {"tango",
       "the recording of a Tango tablet",
       61'000,
       1,
       0,
       [](std::uint64_t) { return AsItComes(ReadTango(), false); }},
      {"equidistant_room",
       "the recording of a sensor stick, its clock off by 19 ms",
       62'000,
       1,
       0,
       [](std::uint64_t) { return AsItComes(ReadRoom(), false); }}};
  std::uint64_t seed = 63'000;
  for (const int keyframes : {12, 20}) {
    kinds.push_back(
        {fmt::format("euroc_v1_01_{}", keyframes),
         fmt::format("EuRoC V1_01, segments of {} keyframes", keyframes),
         seed,
         1,
         0,
         [=](std::uint64_t) { return AsItComes(ReadEuroc(keyframes), true); }});
    seed += 1'000;
  }
  return kinds;
}

}  // namespace selfcal
