// Points in time as people give them on the command line.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/timestamp.pb.h>

#include <string>

namespace selfcal::client {

// "2026-11-21", "2026-11-21 04:10:03" (or with a T; in UTC), or a time before
// `now`: "30s", "15m", "2h", "7d". INVALID_ARGUMENT for anything else.
absl::StatusOr<google::protobuf::Timestamp> ParseTime(
    const std::string& text, const google::protobuf::Timestamp& now);

}  // namespace selfcal::client
