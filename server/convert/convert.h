// Conversion between results of the estimation core and their messages, which
// the worker, the database and the contract share. Doubles are preserved to the
// bit. The counterpart for values of core/model is proto/convert.h.
#pragma once

#include <google/protobuf/repeated_field.h>
#include <google/protobuf/repeated_ptr_field.h>

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/information/segment_information.h"
#include "selfcal/v1/calibration.pb.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::server {

using VectorMessage = google::protobuf::RepeatedField<double>;
void ToProto(const Eigen::VectorXd& vector, VectorMessage* message);
Eigen::VectorXd FromProto(const VectorMessage& message);

using DirectionMessages =
    google::protobuf::RepeatedPtrField<v1::UnobservedDirection>;
void ToProto(const std::vector<UnobservedDirection>& directions,
             DirectionMessages* messages);
std::vector<UnobservedDirection> FromProto(const DirectionMessages& messages);

v1::GroupScore ToProto(const GroupScore& score);  // without in_table
GroupScore FromProto(const v1::GroupScore& message);

v1::ResidualStatistics ToProto(const ResidualStatistics& residuals);
ResidualStatistics FromProto(const v1::ResidualStatistics& message);

// The message names segments of the rig by `rig`. Without theta, covariance and
// Lambda, which have messages of their own.
v1::SolverReport ToProto(const CalibrationResult& result,
                         const std::string& rig,
                         double seconds);
CalibrationResult FromProto(const v1::SolverReport& message);

}  // namespace selfcal::server
