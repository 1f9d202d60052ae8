// The contract by its descriptors: every method, its rule of access, and
// requests for it.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/dynamic_message.h>

#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "selfcal/v1/activity_service.pb.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/recalibration.pb.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/segment.pb.h"
#include "selfcal/v1/store_service.pb.h"
#include "server/access/rules.h"

namespace selfcal::server {

using google::protobuf::MethodDescriptor;

// Those of the six services; a test compares these with the services that the
// server offers.
inline std::vector<const google::protobuf::ServiceDescriptor*> Services() {
  std::vector<const google::protobuf::ServiceDescriptor*> services;
  for (const auto* file : {v1::GetRigRequest::descriptor()->file(),
                           v1::GetSegmentRequest::descriptor()->file(),
                           v1::GetCalibrationRequest::descriptor()->file(),
                           v1::GetRecalibrationRequest::descriptor()->file(),
                           v1::ListEventsRequest::descriptor()->file(),
                           v1::ListActivityRequest::descriptor()->file()}) {
    for (int s = 0; s < file->service_count(); ++s) {
      services.push_back(file->service(s));
    }
  }
  return services;
}

inline std::vector<const MethodDescriptor*> Methods() {
  std::vector<const MethodDescriptor*> methods;
  for (const auto* service : Services()) {
    for (int m = 0; m < service->method_count(); ++m) {
      methods.push_back(service->method(m));
    }
  }
  return methods;
}

inline const AccessRule& RuleOf(const MethodDescriptor& method) {
  for (const AccessRule& rule : AccessRules()) {
    if (rule.method == method.full_name()) return rule;
  }
  throw std::runtime_error(method.full_name() + " has no access rule");
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
  std::istringstream fields{std::string(RuleOf(method).rig_field)};
  for (std::string field; std::getline(fields, field, ',');) {
    SetAt(request.get(), field, name);
  }
  return request;
}

}  // namespace selfcal::server
