// The datasets that the experiments share: one hand-held device, carried 15
// times for 3 minutes, with calm and excited parts. Ten motions are analytic,
// five were recorded with real devices (four by hand, one drone); of a
// recording shorter than 3 minutes there is what there is. Where a recording is
// missing, another analytic motion stands in, and the name says so.
//
// Made on demand and the same every time; about 20 MB each.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"

namespace selfcal {

inline constexpr int kDatasets = 15;
inline constexpr double kDatasetDuration_s = 180;

// The same truth for all datasets, so that estimates can be compared over
// them, and a factory calibration that is off by CalibrationError.
struct EvaluatedDevice {
  Rig rig;  // rig.factory is wrong; the SLAM system runs on it
  Calibration truth;
};
EvaluatedDevice MakeDevice();

struct Motion {
  std::string name;  // "mixed-3", "tumvi_room1_handheld", "mixed-12-for-..."
  bool recorded = false;
  std::unique_ptr<Trajectory> trajectory;
};
// The motion of dataset 0 .. kDatasets - 1: two thirds analytic, then the
// recorded. Analytic ones last duration_s, recorded ones at most as long.
Motion MakeMotion(int dataset, double duration_s = kDatasetDuration_s);

struct Dataset {
  std::string name;
  bool recorded = false;
  double duration_s = 0;
  Rig rig;
  Calibration truth;
  SimulatedSession session;  // as Simulate(): segments and their truth

  const std::vector<MotionSegment>& segments() const {
    return session.segments;
  }
};
// IMU 200 Hz, keyframes 10 Hz, 40 keyframes a segment. A landmark that is lost
// is not found again, as none of 5,275 is in the recording of a Tango tablet
// (tango_handheld): with many that are, batch has to eliminate every keyframe
// against every other.
Dataset MakeDataset(int dataset, double duration_s = kDatasetDuration_s);

// The options and device that MakeDataset() uses, for variants: other noise,
// other outliers, another duration, another seed.
SimulationOptions DatasetOptions(int dataset);
Dataset MakeDataset(int dataset,
                    double duration_s,
                    const EvaluatedDevice& device,
                    const SimulationOptions& options);

}  // namespace selfcal
