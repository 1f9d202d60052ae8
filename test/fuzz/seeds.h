// Small valid inputs of the targets, from which a corpus begins.
#pragma once

#include <string>
#include <vector>

namespace selfcal {

struct FuzzSeed {
  std::string target;
  std::string name;
  std::string bytes;
};

// The same at every call.
std::vector<FuzzSeed> FuzzSeeds();

// A sensors.yaml with one IMU and one camera.
std::string FuzzSensorsText();

}  // namespace selfcal
