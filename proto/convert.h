// Conversion between messages of selfcal.v1 and values of core/model, for
// client and server. Input from the network must not abort: a message of the
// wrong shape results in violations with the path of the field; Validate of
// core/model then checks the values.
#pragma once

#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "core/model/segment.h"
#include "selfcal/v1/calibration.pb.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal {

v1::CalibrationParameters ToProto(const Calibration& theta);
v1::Rig ToProto(const Rig& rig);  // without create_time
v1::MotionSegment ToProto(const MotionSegment& segment);

// Fill *value and return no violations, or return every violation of shape
// (column lengths, missing messages, unknown enums, coefficients). `prefix` is
// put before each path. Absent optional fields take their defaults.
std::vector<Violation> FromProto(const v1::CalibrationParameters& message,
                                 const std::string& prefix,
                                 Calibration* theta);
std::vector<Violation> FromProto(const v1::Rig& message,
                                 const std::string& prefix,
                                 Rig* rig);
std::vector<Violation> FromProto(const v1::MotionSegment& message,
                                 const std::string& prefix,
                                 MotionSegment* segment);

}  // namespace selfcal
