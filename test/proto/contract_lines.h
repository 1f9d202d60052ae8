// What clients rely on in the contract, a line each: every message, field,
// enum, value, service and method. A contract that was only added to has all
// the lines that it had before.
#pragma once

#include <google/protobuf/descriptor.h>

#include <set>
#include <string>
#include <vector>

#include "selfcal/v1/activity_service.pb.h"
#include "selfcal/v1/calibration.pb.h"
#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/recalibration.pb.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/segment.pb.h"
#include "selfcal/v1/store_service.pb.h"

namespace selfcal {

using ContractFiles = std::vector<const google::protobuf::FileDescriptor*>;

inline ContractFiles CompiledContract() {
  return {v1::CameraCalibration::descriptor()->file(),
          v1::GetCalibrationRequest::descriptor()->file(),
          v1::GetRecalibrationRequest::descriptor()->file(),
          v1::GetRigRequest::descriptor()->file(),
          v1::GetSegmentRequest::descriptor()->file(),
          v1::ListEventsRequest::descriptor()->file(),
          v1::ListActivityRequest::descriptor()->file()};
}

namespace contract {

using Lines = std::set<std::string>;

inline std::string TypeOf(const google::protobuf::FieldDescriptor& field) {
  if (field.message_type() != nullptr) return field.message_type()->full_name();
  if (field.enum_type() != nullptr) return field.enum_type()->full_name();
  return field.type_name();
}

// Its name is part of the JSON, the rest of the bytes and of generated code.
inline std::string FieldLine(const google::protobuf::FieldDescriptor& field) {
  std::string line = "field " + field.full_name() + " = " +
                     std::to_string(field.number()) + " " + TypeOf(field);
  if (field.is_repeated()) line += field.is_packed() ? " packed" : " repeated";
  if (field.has_presence()) line += " with presence";
  if (const auto* oneof = field.real_containing_oneof()) {
    line += " in " + oneof->name();
  }
  return line;
}

inline void Add(const google::protobuf::EnumDescriptor& type, Lines* lines) {
  lines->insert("enum " + type.full_name());
  for (int v = 0; v < type.value_count(); ++v) {
    lines->insert("value " + type.full_name() + "." + type.value(v)->name() +
                  " = " + std::to_string(type.value(v)->number()));
  }
}

inline void Add(const google::protobuf::Descriptor& type, Lines* lines) {
  lines->insert("message " + type.full_name());
  for (int f = 0; f < type.field_count(); ++f) {
    lines->insert(FieldLine(*type.field(f)));
  }
  for (int e = 0; e < type.enum_type_count(); ++e) {
    Add(*type.enum_type(e), lines);
  }
  for (int n = 0; n < type.nested_type_count(); ++n) {
    Add(*type.nested_type(n), lines);
  }
}

inline std::string MethodLine(
    const google::protobuf::MethodDescriptor& method) {
  return "method " + method.full_name() + ": " +
         (method.client_streaming() ? "stream " : "") +
         method.input_type()->full_name() + " -> " +
         (method.server_streaming() ? "stream " : "") +
         method.output_type()->full_name();
}

}  // namespace contract

inline contract::Lines ContractLines(const ContractFiles& files) {
  contract::Lines lines;
  for (const auto* file : files) {
    for (int m = 0; m < file->message_type_count(); ++m) {
      contract::Add(*file->message_type(m), &lines);
    }
    for (int e = 0; e < file->enum_type_count(); ++e) {
      contract::Add(*file->enum_type(e), &lines);
    }
    for (int s = 0; s < file->service_count(); ++s) {
      for (int m = 0; m < file->service(s)->method_count(); ++m) {
        lines.insert(contract::MethodLine(*file->service(s)->method(m)));
      }
    }
  }
  return lines;
}

}  // namespace selfcal
