// Settings of components on the command line: COMPONENT=VALUE.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/repeated_field.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "selfcal/v1/rig.pb.h"

namespace selfcal::client {

// Splits at the first '=', since a name has none; nullopt without a name.
std::optional<std::pair<std::string, std::string>> SplitPair(
    const std::string& text);

// "--label 'x' is not of the form NAME=VALUE".
absl::Status NotAPair(const std::string& flag,
                      const std::string& text,
                      const std::string& form);

// Appends the settings. INVALID_ARGUMENT if a text is not COMPONENT=NUMBER.
absl::Status ReadSettings(
    const std::string& flag,
    const std::vector<std::string>& texts,
    google::protobuf::RepeatedPtrField<v1::ComponentSetting>* settings);

// INVALID_ARGUMENT, with the components that the rig has, if a pattern of the
// settings names none of them. A block of components, such as imu.gyro.scale,
// becomes the pattern of all of them.
absl::Status NameComponents(
    const std::string& flag,
    const v1::Rig& rig,
    google::protobuf::RepeatedPtrField<v1::ComponentSetting>* settings);

}  // namespace selfcal::client
