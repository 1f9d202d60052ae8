// The devices of the experiment on change, and what becomes of them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/change/consistency.h"
#include "core/model/rig.h"
#include "core/simulation/trajectory.h"
#include "test/evaluation/context.h"

namespace selfcal {

inline constexpr double kChangeSegment_s = 4.0;

// A device whose active calibration came of a session of its own.
struct ChangeDevice {
  Rig rig;
  Calibration truth;
  KnownCalibration active;
};

// Another factory calibration and another session for each index.
ChangeDevice MakeChangeDevice(int index);
// Of a session of that motion.
ChangeDevice MakeChangeDevice(int index, const Trajectory& motion);

// A CameraChange, at once or by as much with every segment.
struct DeviceChange {
  std::string name;
  std::string group;  // concerned
  bool drift = false;
  double turn_deg = 0;
  double focal_relative = 0;

  // In the n-th segment after it began, n >= 1.
  Calibration After(const Calibration& before, int n) const;
};

// The device in use, with calm and excited parts; its SLAM system runs on the
// active calibration. Segments are of the same motion, but each is a session of
// its own: the device may be another in each.
class ChangeUse {
 public:
  ChangeUse(const ChangeDevice& device, int segments, std::uint64_t seed);
  MotionSegment Segment(int i, const Calibration& truth) const;

 private:
  const ChangeDevice& device_;
  const std::uint64_t seed_;
  const std::unique_ptr<Trajectory> motion_;
};

// The parts of the experiment "change": tables, plots and figures.
// False alarms of segments in sequence (change_rates.cc).
void RunChangeRates(const ChangeDevice& device,
                    const std::vector<SegmentInformation>& pool,
                    Context* context);
// How soon changes are found (change_delay.cc).
void RunChangeDelays(const std::vector<ChangeDevice>& devices,
                     Context* context);
// The calibration after a change (change_recalibration.cc).
void RunChangeRecalibrations(const std::vector<ChangeDevice>& devices,
                             Context* context);
// On a real recording, where it is there (change_recorded.cc).
void RunChangeRecorded(Context* context);

}  // namespace selfcal
