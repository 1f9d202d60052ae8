// Conversion of parts that several records share: matrices, vectors,
// directions.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/repeated_field.h>
#include <google/protobuf/repeated_ptr_field.h>

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "selfcal/store/records.pb.h"
#include "selfcal/v1/calibration.pb.h"

namespace selfcal::server {

void PutMatrix(const Eigen::MatrixXd& matrix, store::MatrixRecord* record);
// False if the number of values does not match the dimensions.
bool GetMatrix(const store::MatrixRecord& record, Eigen::MatrixXd* matrix);

// Extends a matrix or vector over the tangent space of theta that was stored
// before cameras had a time offset: inserts zeros for that of each camera,
// which was known then. Leaves any other unchanged.
void AddTimeOffsets(const Calibration& theta, Eigen::MatrixXd* matrix);
void AddTimeOffsets(const Calibration& theta, Eigen::VectorXd* vector);

void PutVector(const Eigen::VectorXd& vector,
               google::protobuf::RepeatedField<double>* values);
Eigen::VectorXd GetVector(
    const google::protobuf::RepeatedField<double>& values);

using DirectionMessages =
    google::protobuf::RepeatedPtrField<v1::UnobservedDirection>;
void PutDirections(const std::vector<UnobservedDirection>& directions,
                   DirectionMessages* messages);
std::vector<UnobservedDirection> GetDirections(
    const DirectionMessages& messages);

absl::Status DamagedRecord(const std::string& what);

}  // namespace selfcal::server
