// Errors as a client sees them: the canonical code, a message that says what to
// do, and google.rpc details (BadRequest, ResourceInfo, RetryInfo) in the
// trailer. All handlers use these functions.
//
// Trailers are small (8 KiB in gRPC), so that texts and lists from a request
// are truncated: an error always reaches its client.
#pragma once

#include <absl/status/status.h>
#include <grpcpp/support/status.h>

#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/segment.h"

namespace selfcal::server {

// The subject of a failed call; parts that do not apply are empty.
struct Subject {
  std::string type;   // e.g. "selfcal.v1.Rig"
  std::string name;   // e.g. "rigs/a"
  std::string field;  // field of the request that INVALID_ARGUMENT refers to
};

// Converts an error of the store or the pipeline. OK stays OK.
grpc::Status ToGrpc(const absl::Status& status, const Subject& subject);

// INVALID_ARGUMENT with as many violations as fit; `violations` must not be
// empty.
grpc::Status InvalidFields(const std::vector<Violation>& violations);

// INVALID_ARGUMENT for a name that does not match `pattern`.
grpc::Status BadName(std::string_view field, std::string_view pattern);

// UNAVAILABLE with a delay after which to reconnect.
grpc::Status ShuttingDown();

// Runs a handler; no exception leaves it.
template <typename Handler>
grpc::Status Guarded(const Handler& handler) {
  try {
    return handler();
  } catch (const std::bad_alloc&) {
    return ToGrpc(
        absl::ResourceExhaustedError("out of memory; send smaller requests"),
        {});
  } catch (const std::exception& error) {
    return ToGrpc(absl::InternalError(error.what()), {});
  }
}

}  // namespace selfcal::server
