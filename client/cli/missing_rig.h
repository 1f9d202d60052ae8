// Help for a rig that the daemon does not know.
#pragma once

#include <grpcpp/grpcpp.h>

#include <string>
#include <vector>

#include "client/cli/context.h"

namespace selfcal::client {

// Reads the names of the rigs, at most one page, within this time; empty after
// an error.
std::vector<std::string> ReadRigNames(const Context& context,
                                      std::chrono::milliseconds time);

// Returns a line to add to an error: the rig that was meant, or how to list
// them. Empty unless the status is NOT_FOUND and names a rig that does not
// exist among others that do.
std::string MissingRigHint(const Context& context, const grpc::Status& status);

}  // namespace selfcal::client
