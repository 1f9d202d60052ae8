// Motions of a device whose data is as it should be: carried by hand, calm,
// with few keyframes, turned in place.
#include <fmt/format.h>

#include "core/simulation/random.h"
#include "test/evaluation/trust_kinds.h"
#include "test/evaluation/trust_simulation.h"

namespace selfcal {
namespace {

constexpr std::uint64_t kPivotStream = 301;

TrustDevice Handheld(std::uint64_t seed) {
  TrustDevice device = MakeTrustDevice(seed);
  AddSession(MakeHandheld(kTrustSession_s, 1, seed),
             "handheld",
             TrustOptions(seed),
             &device);
  return device;
}

TrustDevice Mixed(std::uint64_t seed) {
  TrustDevice device = MakeTrustDevice(seed);
  AddSession(MakeMixed(1.5 * kTrustSession_s, seed),
             "mixed",
             TrustOptions(seed),
             &device);
  return device;
}

TrustDevice Calm(std::uint64_t seed) {
  TrustDevice device = MakeTrustDevice(seed);
  AddSession(MakeHandheld(1.5 * kTrustSession_s, 0.15, seed),
             "calm",
             TrustOptions(seed),
             &device);
  return device;
}

// As from a visual odometry that makes a keyframe now and then.
TrustDevice Sparse(std::uint64_t seed, double rate_hz, int keyframes) {
  TrustDevice device = MakeTrustDevice(seed);
  SimulationOptions options = TrustOptions(seed);
  options.keyframe_rate_hz = rate_hz;
  options.keyframes_per_segment = keyframes;
  options.mean_track_length = 6;
  AddSession(MakeHandheld(2.5 * kTrustSession_s, 0.5, seed),
             "sparse",
             options,
             &device);
  return device;
}

std::shared_ptr<const Trajectory> Rotation(double distance_m,
                                           std::uint64_t seed) {
  Random random(seed, kPivotStream);
  RotationInPlaceOptions options;
  options.pivot_I = distance_m * random.Direction();
  return MakeRotationInPlace(kTrustSession_s, options, seed);
}

// Tables of 8, the default: with smaller ones fewer of these devices fail.
TrustDevice RotationInPlace(std::uint64_t seed, double distance_m) {
  TrustDevice device = MakeTrustDevice(seed, 8);
  AddSession(
      Rotation(distance_m, seed), "rotation", TrustOptions(seed), &device);
  return device;
}

TrustDevice RotationThenGood(std::uint64_t seed) {
  TrustDevice device = RotationInPlace(seed, 0.05);
  AddSession(MakeHandheld(kTrustSession_s, 1, seed),
             "handheld",
             TrustOptions(seed),
             &device);
  return device;
}

}  // namespace

std::vector<TrustKind> MotionKinds() {
  std::vector<TrustKind> kinds = {
      {"handheld", "carried about vigorously", 10'000, 20, 1, Handheld},
      {"mixed", "calm and vigorous stretches, 90 s", 11'000, 12, 0, Mixed},
      {"calm", "carried calmly, 90 s", 12'000, 12, 0, Calm},
      {"sparse_1hz",
       "a keyframe a second, segments of 12, 150 s",
       13'000,
       12,
       0,
       [](std::uint64_t seed) { return Sparse(seed, 1, 12); }},
      {"sparse_2hz",
       "two keyframes a second, segments of 20, 150 s",
       14'000,
       12,
       0,
       [](std::uint64_t seed) { return Sparse(seed, 2, 20); }},
      {"rotation_then_good",
       "turned in place about a pivot 5 cm beside the IMU, then carried about",
       20'000,
       12,
       0,
       RotationThenGood}};
  std::uint64_t first_seed = 15'000;
  for (const int distance_cm : {0, 5, 10, 50}) {
    kinds.push_back(
        {fmt::format("rotation_{}cm", distance_cm),
         fmt::format("turned in place, the pivot {} cm from the IMU",
                     distance_cm),
         first_seed,
         distance_cm <= 5 ? 16 : 10,
         distance_cm == 5 ? 1 : 0,
         [=](std::uint64_t seed) {
           return RotationInPlace(seed, 0.01 * distance_cm);
         }});
    first_seed += 1'000;
  }
  return kinds;
}

}  // namespace selfcal
