// Conversion of parts that several records share.
#pragma once

#include <absl/status/status.h>

#include <Eigen/Core>
#include <string>

#include "core/calibration/calibrate.h"
#include "core/model/calibration.h"
#include "selfcal/store/records.pb.h"

namespace selfcal::server {

void PutMatrix(const Eigen::MatrixXd& matrix, store::MatrixRecord* record);
// False if the number of values does not match the dimensions.
bool GetMatrix(const store::MatrixRecord& record, Eigen::MatrixXd* matrix);

// Extends a matrix or vector over the tangent space of theta that was stored
// before cameras had a time offset: inserts zeros for that of each camera,
// which was known then. Leaves any other unchanged.
void AddTimeOffsets(const Calibration& theta, Eigen::MatrixXd* matrix);
void AddTimeOffsets(const Calibration& theta, Eigen::VectorXd* vector);

// `moved` and `sigmas` may be empty. False if they have not the size of theta.
void PutStep(const CalibrateProgress& step, store::StepRecord* record);
bool GetStep(const store::StepRecord& record, CalibrateProgress* step);

absl::Status DamagedRecord(const std::string& what);

}  // namespace selfcal::server
