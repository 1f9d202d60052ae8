// Calls about rigs that devices report: a hub refuses them, and has the device
// make them instead.
#pragma once

#include <grpcpp/support/status.h>

#include <optional>
#include <string>

#include "client/cli/context.h"
#include "selfcal/v1/uplink.pb.h"

namespace selfcal::client {

// The instruction by which a call is made that failed with this status.
// nullopt if that would not help: the call failed for another reason than that
// a device reports the rig. Sets *failure if the instruction was refused.
std::optional<v1::Instruction> InsteadOf(const grpc::Status& failed,
                                         const Context& context,
                                         const std::string& rig,
                                         const v1::Instruction& instruction,
                                         grpc::Status* failure);

// "instruction 4 is given to the device of rig tablet: ...", or JSON.
void PrintGiven(const Context& context, const v1::Instruction& instruction);

// Ends a command whose call has this status, unless it succeeded: gives the
// instruction and prints it, or prints the error. Returns the exit code;
// nullopt if the call succeeded.
std::optional<int> EndFailed(const grpc::Status& status,
                             const Context& context,
                             const std::string& rig,
                             const v1::Instruction& instruction);

}  // namespace selfcal::client
