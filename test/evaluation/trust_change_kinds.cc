// Devices that change between two sessions, or slowly over many.
#include <fmt/format.h>

#include <numbers>

#include "test/evaluation/trust_kinds.h"
#include "test/evaluation/trust_simulation.h"

namespace selfcal {
namespace {

constexpr double kCalm = 0.15;  // excitation
constexpr double kTurn_deg = 0.2;
constexpr double kDrift_px = 1;  // over all sessions
constexpr int kDriftSessions = 10;

// The camera turns between two calm sessions.
TrustDevice Turned(std::uint64_t seed) {
  TrustDevice device = MakeTrustDevice(seed);
  AddSession(MakeHandheld(1.5 * kTrustSession_s, kCalm, seed),
             "before",
             TrustOptions(seed),
             &device);
  device.truth = ChangeCamera(*device.truth,
                              {.turn_rad = kTurn_deg * std::numbers::pi / 180});
  device.changed_session = 1;
  AddSession(MakeHandheld(1.5 * kTrustSession_s, kCalm, seed + 1),
             "after",
             TrustOptions(seed + 1),
             &device);
  return device;
}

// The focal length grows from session to session, as a lens that warms up; none
// of them is long enough to show it.
TrustDevice Drifting(std::uint64_t seed) {
  TrustDevice device = MakeTrustDevice(seed);
  device.changed_session = 1;
  for (int i = 0; i <= kDriftSessions; ++i) {
    const std::uint64_t session_seed =
        20 * seed + static_cast<std::uint64_t>(i);
    AddSession(MakeMixed(kTrustSession_s, session_seed),
               fmt::format("session-{}", i),
               TrustOptions(session_seed),
               &device);
    device.truth->cameras[0].f.array() += kDrift_px / kDriftSessions;
  }
  return device;
}

}  // namespace

std::vector<TrustKind> ChangeKinds() {
  return {{"turn_0_2deg",
           "the camera turns by 0.2 degrees between two calm sessions",
           50'000,
           12,
           0,
           Turned},
          {"drift_focal",
           "the focal length grows by 1 px in 10 minutes",
           51'000,
           6,
           0,
           Drifting}};
}

}  // namespace selfcal
