// Errors as a client sees them: the canonical code, a message that says what to
// do, and google.rpc details (BadRequest, ResourceInfo, RetryInfo) as payloads
// of the status. All handlers use these functions.
//
// gRPC sends the details in a trailer, which is small (8 KiB), so that texts
// and lists from a request are truncated: an error always reaches its client.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <string_view>
#include <vector>

#include "core/model/segment.h"
#include "google/rpc/status.pb.h"

namespace selfcal::server {

// Types of resources, as errors name them.
inline constexpr char kCalibrationType[] = "selfcal.v1.Calibration";
inline constexpr char kRigType[] = "selfcal.v1.Rig";
inline constexpr char kRunType[] = "selfcal.v1.Recalibration";
inline constexpr char kSegmentType[] = "selfcal.v1.Segment";
inline constexpr char kSessionType[] = "selfcal.v1.Session";
inline constexpr char kTableType[] = "selfcal.v1.Table";

// The subject of a failed call; parts that do not apply are empty.
struct Subject {
  std::string type;   // e.g. kRigType
  std::string name;   // e.g. "rigs/a"
  std::string field;  // field of the request that INVALID_ARGUMENT refers to
};

// Adds the details to an error of the store or the pipeline. OK stays OK.
absl::Status About(const absl::Status& status, const Subject& subject);

// INVALID_ARGUMENT with as many violations as fit; `violations` must not be
// empty.
absl::Status InvalidFields(const std::vector<Violation>& violations);

// INVALID_ARGUMENT for a name that does not match `pattern`.
absl::Status BadName(std::string_view field, std::string_view pattern);

// UNAVAILABLE with a delay after which to reconnect.
absl::Status ShuttingDown();

// Bounds the message, and adds the delay after which to retry an UNAVAILABLE or
// RESOURCE_EXHAUSTED error. OK stays OK.
absl::Status ForClient(const absl::Status& status);

// The error with its details, as gRPC and HTTP send it.
google::rpc::Status ToMessage(const absl::Status& status);

}  // namespace selfcal::server
