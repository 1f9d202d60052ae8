// Statistics of an estimator over datasets of one device, by parameter: what
// the tables of the paper show, and the errors against truth.
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "core/model/calibration.h"
#include "test/evaluation/table.h"

namespace selfcal {

// Of one dataset.
struct Estimate {
  Calibration theta;
  Eigen::VectorXd sigma;  // claimed, of each tangent component
};

// The average: rotations as in AverageRotation(), all else the mean.
Calibration AverageCalibration(const std::vector<Calibration>& thetas);

// By tangent component; those of rotations are Rodrigues angles [rad].
struct ParameterStatistics {
  Calibration average;
  Eigen::VectorXd spread;     // standard deviation about the average
  Eigen::VectorXd rms_error;  // against truth
  Eigen::VectorXd rms_sigma;  // claimed
};

// Of at least two estimates.
ParameterStatistics Summarise(const Calibration& truth,
                              const std::vector<Estimate>& estimates);

// One row for each component that is estimated: truth, and for each named
// estimator average, spread, error and claimed sigma.
ResultTable CompareParameters(
    const Calibration& truth,
    const std::vector<std::pair<std::string, ParameterStatistics>>& estimators);

// The elements of a / b, without those of components that are not estimated:
// their spread and their sigma is exactly zero, and b with them.
std::vector<double> Ratios(const Eigen::VectorXd& a, const Eigen::VectorXd& b);

}  // namespace selfcal
