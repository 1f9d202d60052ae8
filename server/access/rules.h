// Checks the roles that the methods of the contract require: their option
// selfcal.v1.access. A method without a rule is denied to everybody. Any thread
// may call.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <string>

#include "server/access/grants.h"

namespace selfcal::server {

// Returns OK if the caller may make the call with this request; otherwise
// PERMISSION_DENIED with a message that names the missing role. If the name of
// the rig is empty in the request, the role on any rig is sufficient, unless
// the rule says otherwise: in a stream the name in the first message applies to
// later ones, and no other method accepts an empty name.
absl::Status Authorise(const Caller& caller,
                       const google::protobuf::MethodDescriptor& method,
                       const google::protobuf::Message& request);

// The {rig} that the request names, by the rule of its method; empty if the
// request names none, or several.
std::string RigOf(const google::protobuf::MethodDescriptor& method,
                  const google::protobuf::Message& request);

}  // namespace selfcal::server
