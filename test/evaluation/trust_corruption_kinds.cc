// Devices some of whose segments are corrupt.
#include <functional>
#include <utility>

#include "test/evaluation/corruptions.h"
#include "test/evaluation/trust_kinds.h"
#include "test/evaluation/trust_simulation.h"

namespace selfcal {
namespace {

constexpr int kCorruptEvery = 5;  // of a session: 20 percent
constexpr int kSpikeEvery = 10;
constexpr double kLate_s = 0.01;
constexpr double kLostScale = 0.7;
constexpr double kGoodSession_s = 1.5 * kTrustSession_s;

// The i-th segment as it goes wrong.
using Corruption = std::function<MotionSegment(
    const TrustDevice& device, const SimulatedSession& session, int i)>;

// A device with every so many-th segment corrupt; clean, with what `clean` has
// in its place, or without it.
TrustKind Corrupt(std::string name,
                  std::string about,
                  std::uint64_t first_seed,
                  int devices,
                  int quick_devices,
                  TrustDevice (*device_of)(std::uint64_t seed),
                  int every,
                  const Corruption& corrupt,
                  const Corruption& clean = nullptr) {
  const auto make = [=](std::uint64_t seed, bool corrupted) {
    TrustDevice device = device_of(seed);
    const TrustDevice base = device;
    AddSession(
        MakeHandheld(kGoodSession_s, 1, seed),
        "handheld",
        TrustOptions(seed),
        &device,
        [=](const Calibration&, SimulatedSession* session) {
          const SimulatedSession good = *session;
          session->segments.clear();
          const int count = static_cast<int>(good.segments.size());
          const int first = static_cast<int>(seed) % every;
          for (int i = 0; i < count; ++i) {
            if (i % every != first) {
              session->segments.push_back(good.segments[i]);
            } else if (const Corruption& one = corrupted ? corrupt : clean) {
              session->segments.push_back(one(base, good, i));
            }
          }
        });
    return device;
  };
  return {std::move(name),
          std::move(about),
          first_seed,
          devices,
          quick_devices,
          [=](std::uint64_t seed) { return make(seed, true); },
          [=](std::uint64_t seed) { return make(seed, false); }};
}

TrustDevice Mono(std::uint64_t seed) { return MakeTrustDevice(seed); }

// A second camera beside the first.
TrustDevice Stereo(std::uint64_t seed) {
  TrustDevice device = MakeTrustDevice(seed);
  CameraCalibration second = HandheldRig("").factory.cameras[0];
  second.p_CI.x() -= 0.1;
  device.truth->cameras.push_back(second);
  Calibration two = device.rig.factory;
  two.cameras.push_back(second);
  device.rig.factory.cameras.push_back(
      PerturbCalibration(two, {}, seed).cameras[1]);
  device.sensors = device.rig;
  return device;
}

// Another specimen on the same motion.
MotionSegment OtherDevice(const TrustDevice& device,
                          const SimulatedSession& session,
                          int i) {
  const std::uint64_t seed =
      static_cast<std::uint64_t>(session.segments[i].keyframes.size()) + i;
  const Calibration other = PerturbCalibration(*device.truth, {}, seed);
  SimulatedSession theirs = Simulate(device.rig,
                                     other,
                                     device.rig.factory,
                                     *MakeHandheld(4.5, 1, seed),
                                     "other",
                                     TrustOptions(seed));
  MotionSegment segment = std::move(theirs.segments.front());
  segment.key = session.segments[i].key;
  return segment;
}

TrustDevice DivergedThenGood(std::uint64_t seed, bool diverged) {
  TrustDevice device = MakeTrustDevice(seed, 8);
  if (diverged) {
    AddSession(MakeHandheld(kTrustSession_s, 1, seed + 1),
               "diverged",
               TrustOptions(seed + 1),
               &device,
               [=](const Calibration&, SimulatedSession* session) {
                 session->segments = Diverge(session->segments, {}, seed);
               });
  }
  AddSession(MakeHandheld(kGoodSession_s, 1, seed),
             "handheld",
             TrustOptions(seed),
             &device);
  return device;
}

TrustKind BadSample(std::string name,
                    std::uint64_t first_seed,
                    int quick_devices,
                    double value_radps) {
  return Corrupt(
      std::move(name),
      "one corrupt reading of the gyroscope in each tenth segment",
      first_seed,
      10,
      quick_devices,
      Mono,
      kSpikeEvery,
      [=](const TrustDevice&, const SimulatedSession& session, int i) {
        return CorruptGyroSample(session.segments[i], value_radps, i);
      },
      // It is beyond the full scale, and left out: the segment is sound.
      [](const TrustDevice&, const SimulatedSession& session, int i) {
        return session.segments[i];
      });
}

}  // namespace

std::vector<TrustKind> CorruptionKinds() {
  return {
      Corrupt("corrupt_20_percent_stamps",
              "every fifth segment has stamps that are wrong by 10 ms",
              40'000,
              8,
              0,
              Mono,
              kCorruptEvery,
              [](const TrustDevice&, const SimulatedSession& session, int i) {
                return ShiftStamps(session.segments[i],
                                   i % 2 == 0 ? kLate_s : -kLate_s);
              }),
      Corrupt("corrupt_20_percent_cameras",
              "stereo; in every fifth segment the cameras are exchanged",
              41'000,
              8,
              0,
              Stereo,
              kCorruptEvery,
              [](const TrustDevice& device,
                 const SimulatedSession& session,
                 int i) {
                return SwapCameras(session.segments[i], *device.truth);
              }),
      Corrupt("corrupt_20_percent_device",
              "every fifth segment is of another device",
              42'000,
              8,
              0,
              Mono,
              kCorruptEvery,
              OtherDevice),
      Corrupt(
          "corrupt_20_percent_scene",
          "in every fifth segment half of the scene moves",
          43'000,
          8,
          0,
          Mono,
          kCorruptEvery,
          [](const TrustDevice& device,
             const SimulatedSession& session,
             int i) {
            return MoveScene(
                session.segments[i], session.truth[i], *device.truth, {}, i);
          }),
      Corrupt(
          "corrupt_20_percent_scale",
          "in every fifth segment SLAM has lost the scale",
          44'000,
          8,
          0,
          Mono,
          kCorruptEvery,
          [](const TrustDevice&, const SimulatedSession& session, int i) {
            return LoseScale(session.segments[i],
                             i % 2 == 0 ? kLostScale : 1 / kLostScale);
          },
          // Readings and tracks are sound, only the states are not.
          [](const TrustDevice&, const SimulatedSession& session, int i) {
            return session.segments[i];
          }),
      BadSample("one_bad_sample_35", 45'000, 0, 35),
      BadSample("one_bad_sample_999", 46'000, 1, 999),
      {"diverged_then_good",
       "60 s of a filter that diverged, then 90 s carried about",
       47'000,
       10,
       0,
       [](std::uint64_t seed) { return DivergedThenGood(seed, true); },
       [](std::uint64_t seed) { return DivergedThenGood(seed, false); }},
  };
}

}  // namespace selfcal
