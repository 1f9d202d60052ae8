// Estimates as people read and compare them: a rotation as what it differs by
// from the factory's value, in degrees. Its rotation vector, near pi, changes
// the sign from one version to the next though nothing has moved.
#pragma once

#include <string>

#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::client {

struct ShownEstimate {
  double value = 0;
  double sigma = 0;
  std::string unit;  // of both; "deg from factory" of a rotation
};

// A daemon from before the difference was told leaves a rotation as its vector.
ShownEstimate Shown(const v1::ComponentEstimate& estimate);

struct ShownDifference {
  double a = 0;
  double b = 0;
  double difference = 0;
  double sigma = 0;
  std::string unit;  // of all
};
ShownDifference Shown(
    const v1::CompareCalibrationsResponse::Difference& difference);

// "good", "weak", ...; what the daemon has stored with the version.
std::string VerdictText(const v1::Calibration& calibration);

}  // namespace selfcal::client
