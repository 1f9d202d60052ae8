// The contract by its descriptors: every method, its rule of access, and
// requests for it.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/dynamic_message.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "selfcal/v1/access.pb.h"
#include "selfcal/v1/activity_service.pb.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/fleet.pb.h"
#include "selfcal/v1/recalibration.pb.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/segment.pb.h"
#include "selfcal/v1/session.pb.h"
#include "selfcal/v1/store_service.pb.h"
#include "selfcal/v1/uplink.pb.h"
#include "server/access/grants.h"

namespace selfcal::server {

using google::protobuf::MethodDescriptor;

// Those of the contract; a test compares these with the services that the
// server offers.
inline std::vector<const google::protobuf::ServiceDescriptor*> Services() {
  std::vector<const google::protobuf::ServiceDescriptor*> services;
  for (const auto* file : {v1::GetRigRequest::descriptor()->file(),
                           v1::GetSegmentRequest::descriptor()->file(),
                           v1::GetCalibrationRequest::descriptor()->file(),
                           v1::GetRecalibrationRequest::descriptor()->file(),
                           v1::ListEventsRequest::descriptor()->file(),
                           v1::ListSessionsRequest::descriptor()->file(),
                           v1::ListActivityRequest::descriptor()->file(),
                           v1::DescribeCohortRequest::descriptor()->file(),
                           v1::ReportRequest::descriptor()->file()}) {
    for (int s = 0; s < file->service_count(); ++s) {
      services.push_back(file->service(s));
    }
  }
  return services;
}

// All methods, or those for which `chosen` returns true.
template <typename Chosen>
std::vector<const MethodDescriptor*> MethodsThat(const Chosen& chosen) {
  std::vector<const MethodDescriptor*> methods;
  for (const auto* service : Services()) {
    for (int m = 0; m < service->method_count(); ++m) {
      if (chosen(*service->method(m))) methods.push_back(service->method(m));
    }
  }
  return methods;
}

inline bool IsOpenToAnybody(const MethodDescriptor& method) {
  return method.options().GetExtension(v1::access).role() ==
         v1::AccessRule::ANYBODY;
}

// True if the method answers for the rigs of the caller.
inline bool IsLimitedToRights(const MethodDescriptor& method) {
  return method.options().GetExtension(v1::access).limited_to_rights();
}

// The methods that need a role.
inline std::vector<const MethodDescriptor*> Methods() {
  return MethodsThat(
      [](const auto& method) { return !IsOpenToAnybody(method); });
}

// The access rule of a method, as its option in the contract states it.
struct AccessRule {
  Role role = Role::kAdminister;
  std::vector<std::string> rig_field;
};

inline AccessRule RuleOf(const MethodDescriptor& method) {
  const v1::AccessRule& rule = method.options().GetExtension(v1::access);
  if (rule.role() < v1::AccessRule::READ ||
      rule.role() > v1::AccessRule::ADMINISTER) {
    throw std::runtime_error(method.full_name() + " has no access rule");
  }
  return {static_cast<Role>(rule.role() - v1::AccessRule::READ),
          {rule.rig_field().begin(), rule.rig_field().end()}};
}

// Writes the name to the field at a path like "rig.name".
inline void SetAt(google::protobuf::Message* message,
                  const std::string& path,
                  const std::string& name) {
  const auto dot = path.find('.');
  const auto* field =
      message->GetDescriptor()->FindFieldByName(path.substr(0, dot));
  const auto& reflection = *message->GetReflection();
  if (dot == path.npos) {
    reflection.SetString(message, field, name);
  } else {
    SetAt(
        reflection.MutableMessage(message, field), path.substr(dot + 1), name);
  }
}

// A request of the method that names the rig wherever its rule looks for it.
inline std::unique_ptr<google::protobuf::Message> RequestFor(
    const MethodDescriptor& method, const std::string& name) {
  std::unique_ptr<google::protobuf::Message> request(
      google::protobuf::MessageFactory::generated_factory()
          ->GetPrototype(method.input_type())
          ->New());
  for (const std::string& field : RuleOf(method).rig_field) {
    SetAt(request.get(), field, name);
  }
  return request;
}

}  // namespace selfcal::server
