// Simulated devices of the experiment on trust: what their kinds share.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"
#include "test/evaluation/trust_device.h"

namespace selfcal {

// A session of a device: 60 s as most are.
inline constexpr double kTrustSession_s = 60;

// A hand-held device of the seed: its truth is off from HandheldRig() as that
// of another specimen, its factory's calibration from its truth.
TrustDevice MakeTrustDevice(std::uint64_t seed, int table_size = 4);

// As few landmarks as a phone tracks, none of them found again.
SimulationOptions TrustOptions(std::uint64_t seed);

// What becomes of a session before it is sent.
using SessionEdit =
    std::function<void(const Calibration& theta_slam, SimulatedSession*)>;

// Adds a session of this motion, with the truth and sensors of the device as
// they are now.
void AddSession(std::shared_ptr<const Trajectory> motion,
                const std::string& name,
                const SimulationOptions& options,
                TrustDevice* device,
                SessionEdit edit = nullptr);

}  // namespace selfcal
