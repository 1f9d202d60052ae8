// A calibration in words and tables for people: description, origin, values.
#pragma once

#include <string>

#include "client/cli/table.h"
#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::client {

// State, provenance and the solver's report, with the directions that were held
// constant in words.
Facts DescribeCalibration(const v1::Calibration& calibration);

// A table of component, value, unit and sigma.
Table CalibrationValues(const v1::Calibration& calibration);

// The comparison of two versions: its result, and a table of component, both
// values and the difference with its sigma.
Facts DescribeDifferences(const v1::CompareCalibrationsResponse& differences);
Table DifferenceValues(const v1::CompareCalibrationsResponse& differences);

// One line: version, state, time, summary of the solver.
std::string CalibrationLine(const v1::Calibration& calibration);

// A summary of the solver in a few words; "factory" for the first version.
std::string OriginText(const v1::Calibration& calibration);

}  // namespace selfcal::client
