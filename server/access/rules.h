// Checks the roles that the methods of the contract require: their option
// selfcal.v1.access. A method without a rule is denied to everybody. Any thread
// may call.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <functional>
#include <map>
#include <string>

#include "server/access/grants.h"

namespace selfcal::server {

// Returns the labels of a rig; NOT_FOUND if there is no such rig. It is asked
// only for a caller whose role on the rig depends on them.
using LabelsOf =
    std::function<absl::StatusOr<std::map<std::string, std::string>>(
        const std::string& rig)>;

// Returns OK if the caller may make the call with this request; otherwise
// PERMISSION_DENIED with a message that names the missing role, or the error of
// `labels_of`. If the name of the rig is empty in the request, that of
// `rig_of_stream` applies, which the first message of a stream named; if that
// is empty as well, the role on any rig is sufficient: a method that is limited
// to rights answers for the rigs of the caller alone, and no other method
// accepts an empty name.
absl::Status Authorise(const Caller& caller,
                       const google::protobuf::MethodDescriptor& method,
                       const google::protobuf::Message& request,
                       const LabelsOf& labels_of,
                       const std::string& rig_of_stream = "");

// The {rig} that the request names, by the rule of its method; empty if the
// request names none, or several.
std::string RigOf(const google::protobuf::MethodDescriptor& method,
                  const google::protobuf::Message& request);

}  // namespace selfcal::server
