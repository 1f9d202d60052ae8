// Points in time on the command line.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/timestamp.pb.h>

#include <string>

namespace selfcal::client {

// Parses "2026-11-21" or "2026-11-21 04:10:03" (or with a T), both in UTC, or a
// duration before `now`: "30s", "15m", "2h", "7d". INVALID_ARGUMENT for
// anything else.
absl::StatusOr<google::protobuf::Timestamp> ParseTime(
    const std::string& text, const google::protobuf::Timestamp& now);

}  // namespace selfcal::client
