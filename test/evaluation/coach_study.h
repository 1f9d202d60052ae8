// Following the coach in simulation, against being carried about by hand: how
// well theta is known after each segment.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"

namespace selfcal {

// A device whose factory calibration is off, as the errors of the seed say.
struct CoachedDevice {
  std::string name;
  Rig rig;
  Calibration truth;
};
inline constexpr int kCoachedRigs = 3;
CoachedDevice MakeCoachedDevice(int rig, std::uint64_t seed);

enum class Way {
  kCoached,   // the motion that the coach ranks first, after each segment
  kRandom,    // one of its motions at random, but never to hold still
  kVigorous,  // carried about, MakeHandheld with an excitation of 1
  kMixed,     // carried about, calm and excited by turns (MakeMixed)
};
inline constexpr Way kWays[] = {
    Way::kCoached, Way::kRandom, Way::kVigorous, Way::kMixed};
std::string NameOf(Way way);

struct CoachRecording {
  std::vector<MotionSegment> segments;
  std::vector<std::string> motions;  // of each; empty where it is carried about
  double segment_s = 0;
  // Of what is known after each segment, the prior in it: the largest sigma of
  // all components in reference sigmas.
  std::vector<double> largest;
  double rms_rate_radps = 0;  // how vigorous it was
  double rms_accel_mps2 = 0;  // without gravity

  // Segments until the largest sigma is at most the target; 0: never.
  int SegmentsTo(double target) const;
  // How often the motion changes within the first segments.
  int Changes(int segments) const;
};

// The SLAM system runs on the factory's calibration, at which the segments are
// scored and the coach predicts. Motions, noise and tracks come from the seed,
// none of them that of the coach's own predictions.
CoachRecording Record(const CoachedDevice& device,
                      Way way,
                      int segments,
                      std::uint64_t seed);

}  // namespace selfcal
