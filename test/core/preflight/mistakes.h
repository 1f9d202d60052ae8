// The usual mistakes, planted in data that has none. Each is a mistake of a
// user's own bridge to selfcal: the SLAM system ran with its own driver and
// calibration, and its states are right, but the exported data is not. The same
// mistakes are planted in simulated and in recorded data.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/model/rig.h"
#include "core/model/segment.h"
#include "core/preflight/diagnose.h"

namespace selfcal {

struct FedData {
  Rig rig;  // its factory calibration is the one that is stated
  std::vector<MotionSegment> segments;

  Diagnosis Diagnose() const {
    return selfcal::Diagnose(rig, rig.factory, segments);
  }
};

struct Mistake {
  std::string name;
  std::vector<FindingKind> found;  // the kinds that must be, sorted
  std::string cause;               // a part of the message of the first of them
  std::string remedy;              // and of its remedy
  std::function<void(FedData*)> plant;
  double value = 0;  // of the first finding, where it is known beforehand
};

// The mistakes of both kinds.
std::vector<Mistake> Mistakes();
std::vector<Mistake> ImuMistakes();
std::vector<Mistake> CameraMistakes();

// Changes the place of each landmark.
void ForLandmarks(FedData* data,
                  const std::function<void(Eigen::Vector3d*)>& change);

// The kinds of all findings, sorted, each once; and as text for a failure.
std::vector<FindingKind> Kinds(const Diagnosis& diagnosis);
std::string Text(const Diagnosis& diagnosis);

}  // namespace selfcal
