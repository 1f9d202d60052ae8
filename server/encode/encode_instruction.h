// Instructions of a hub as messages of the contract.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/message.h>

#include <string>

#include "selfcal/v1/uplink.pb.h"
#include "server/store/store.h"

namespace selfcal::server {

// DATA_LOSS if its request is damaged.
absl::StatusOr<v1::Instruction> Encode(const StoredInstruction& instruction);

// The request that the instruction has; null if it has none.
const google::protobuf::Message* RequestOf(const v1::Instruction& instruction);
// The request alone, as it is stored.
std::string SerializeRequest(const v1::Instruction& instruction);

}  // namespace selfcal::server
