// What each method of the contract needs, as one table, and its check.
//
// A method that is not in the table is denied to all. Any thread may call.
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
  // Path of the request's field whose name begins with rigs/{rig}; several with
  // commas, which must all pass. Empty: the method concerns every rig, and
  // needs the role on all of them.
  std::string_view rig_field;
  // An empty name asks for all rigs, and needs the role on all of them.
  bool empty_is_every = false;
};

std::span<const AccessRule> AccessRules();

// Whether the caller may make the call with this request, whose type stands
// for the method. PERMISSION_DENIED with a sentence that names what is missing.
// Where the request leaves the name of the rig empty the role on any rig is
// enough, unless the rule says otherwise: in a stream the first message's name
// holds for the later ones, and no other method takes an empty name.
absl::Status Authorise(const Caller& caller,
                       const google::protobuf::Message& request);

}  // namespace selfcal::server
