// Errors as a client sees them: the canonical code, a sentence that says what
// to do, and google.rpc details (BadRequest, ResourceInfo, RetryInfo) in the
// trailer. One place for all handlers.
//
// Trailers are small (8 KiB in gRPC): texts and lists that come from a request
// are cut so that an error always reaches its client.
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

// What a failed call was about; parts that do not apply stay empty.
struct Subject {
  std::string type;   // e.g. "selfcal.v1.Rig"
  std::string name;   // e.g. "rigs/a"
  std::string field;  // of the request that INVALID_ARGUMENT would blame
};

// An error of the store or the pipeline. OK stays OK.
grpc::Status ToGrpc(const absl::Status& status, const Subject& subject);

// INVALID_ARGUMENT with every violation that fits; `violations` is not empty.
grpc::Status InvalidFields(const std::vector<Violation>& violations);

// INVALID_ARGUMENT for a name that is not of the form of `pattern`.
grpc::Status BadName(std::string_view field, std::string_view pattern);

// UNAVAILABLE with a delay after which to connect again.
grpc::Status ShuttingDown();

// Runs a handler; no exception leaves it.
template <typename Handler>
grpc::Status Guarded(const Handler& handler) {
  try {
    return handler();
  } catch (const std::bad_alloc&) {
    return ToGrpc(
        absl::ResourceExhaustedError("out of memory; send less at once"), {});
  } catch (const std::exception& error) {
    return ToGrpc(absl::InternalError(error.what()), {});
  }
}

}  // namespace selfcal::server
