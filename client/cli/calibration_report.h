// A calibration for people: what it is, where it came from, and its values.
#pragma once

#include <string>

#include "client/cli/table.h"
#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::client {

// State, provenance and the solver's report, what was held constant in words.
Facts DescribeCalibration(const v1::Calibration& calibration);

// Component, value, unit, sigma.
Table CalibrationValues(const v1::Calibration& calibration);

// Verdict on two versions; component, both values, difference with its sigma.
Facts DescribeDifferences(const v1::CompareCalibrationsResponse& differences);
Table DifferenceValues(const v1::CompareCalibrationsResponse& differences);

// A line: version, state, time, what the solver did.
std::string CalibrationLine(const v1::Calibration& calibration);

// What the solver did, in a few words; "factory" for the first version.
std::string OriginText(const v1::Calibration& calibration);

}  // namespace selfcal::client
