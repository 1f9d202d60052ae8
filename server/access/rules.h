// The table of the roles that the methods of the contract require, and its
// check.
//
// A method that is not in the table is denied to everybody. Any thread may
// call.
#pragma once

#include <absl/status/status.h>
#include <google/protobuf/message.h>

#include <span>
#include <string_view>

#include "server/access/grants.h"

namespace selfcal::server {

struct AccessRule {
  std::string_view method;  // full name, e.g. "selfcal.v1.RigService.GetRig"
  Role role = Role::kAdminister;
  // Path of the request's field whose value starts with rigs/{rig}. Several
  // paths are separated by commas, and the role is required for each. Empty:
  // the method concerns all rigs, and requires the role on all of them.
  std::string_view rig_field;
  // An empty value means all rigs, and requires the role on all of them.
  bool empty_is_every = false;
};

std::span<const AccessRule> AccessRules();

// Returns OK if the caller may make the call with this request, whose type
// identifies the method; otherwise PERMISSION_DENIED with a message that names
// the missing role. If the name of the rig is empty in the request, the role on
// any rig is sufficient, unless the rule says otherwise: in a stream the name
// in the first message applies to later ones, and no other method accepts an
// empty name.
absl::Status Authorise(const Caller& caller,
                       const google::protobuf::Message& request);

}  // namespace selfcal::server
