// Values of the contract as text for people.
#pragma once

#include <google/protobuf/timestamp.pb.h>

#include <cstdint>
#include <string>
#include <string_view>

#include "selfcal/v1/calibration.pb.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/recalibration.pb.h"
#include "selfcal/v1/segment.pb.h"
#include "selfcal/v1/store_service.pb.h"

namespace selfcal::client {

// "2026-11-21 04:10:03" in UTC, or "-" without a time.
std::string TimeText(const google::protobuf::Timestamp& time);

// "1 segment", "2 segments"; `plural` for a noun that does not add an s.
std::string CountText(std::int64_t count,
                      std::string_view noun,
                      std::string_view plural = "");

// "1.4 MB".
std::string BytesText(std::int64_t bytes);

// A value with as many decimals as its sigma has at two significant digits;
// without a sigma, with six significant digits.
std::string ValueText(double value, double sigma);
std::string SigmaText(double sigma);

// The part after the last '/': "walk~3" of "rigs/a/segments/walk~3".
std::string LastPart(std::string_view name);
// Returns the {rig} of a name that begins with rigs/{rig}; empty for another.
std::string RigPart(std::string_view name);

std::string StateText(v1::Calibration::State state);
std::string StateText(v1::Segment::State state);
std::string StateText(v1::Recalibration::State state);
std::string TriggerText(v1::Recalibration::Trigger trigger);
std::string KindText(v1::Event::Kind kind);

// "imu.gyro.scale.x" or, for a combination, "0.71 imu.accel.scale.x - 0.70
// cam0.p_CI.z"; in brackets, the ratio of the information of the data to that
// of the prior.
std::string DirectionText(const v1::UnobservedDirection& direction);

}  // namespace selfcal::client
