// Estimates in a form that people can read and compare. A rotation is shown as
// its difference from the factory value, in degrees: a rotation vector near pi
// can change its sign from one version to the next although nothing has moved.
#pragma once

#include <string>

#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::client {

// A difference of estimates in the unit in which people read it: "deg" for
// "rad", every other one as it is.
double ShownValue(double value, const std::string& unit);
std::string ShownUnit(const std::string& unit);

struct ShownEstimate {
  double value = 0;
  double sigma = 0;
  std::string unit;  // of both; "deg from factory" for a rotation
};

// If the daemon is too old to send the difference, a rotation is shown as its
// rotation vector.
ShownEstimate Shown(const v1::ComponentEstimate& estimate);

struct ShownDifference {
  double a = 0;
  double b = 0;
  double difference = 0;
  double sigma = 0;
  std::string unit;  // of all values
};
ShownDifference Shown(
    const v1::CompareCalibrationsResponse::Difference& difference);

// The verdict that the daemon stored with the version: "good", "weak", ...
std::string VerdictText(const v1::Calibration& calibration);

}  // namespace selfcal::client
