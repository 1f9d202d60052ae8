#include "server/encode/encode_instruction.h"

#include <fmt/format.h>

#include "proto/resource_names.h"
#include "server/encode/set_time.h"

namespace selfcal::server {
namespace {

constexpr char kRequest[] = "request";  // the oneof

std::optional<std::string> RigOfChild(const std::string& name,
                                      std::string_view collection) {
  const auto parts = ParseChildName(name, collection);
  if (!parts) return std::nullopt;
  return parts->rig;
}

}  // namespace

absl::StatusOr<v1::Instruction> Encode(const StoredInstruction& instruction) {
  v1::Instruction message;
  if (!message.ParseFromString(instruction.request)) {
    return absl::DataLossError(
        fmt::format("instruction {} for rig {} cannot be read",
                    instruction.instruction,
                    instruction.rig));
  }
  message.set_name(ChildName(instruction.rig,
                             "instructions",
                             std::to_string(instruction.instruction)));
  SetTime(instruction.create_time_ns, message.mutable_create_time());
  message.set_caller(instruction.caller);
  message.set_state(
      static_cast<v1::Instruction::State>(static_cast<int>(instruction.state)));
  message.set_message(instruction.message);
  if (instruction.end_time_ns != 0) {
    SetTime(instruction.end_time_ns, message.mutable_end_time());
  }
  return message;
}

const google::protobuf::Message* RequestOf(const v1::Instruction& instruction) {
  const auto* reflection = instruction.GetReflection();
  const auto* field = reflection->GetOneofFieldDescriptor(
      instruction, instruction.GetDescriptor()->FindOneofByName(kRequest));
  return field == nullptr ? nullptr
                          : &reflection->GetMessage(instruction, field);
}

std::optional<std::string> RigOfRequest(const v1::Instruction& instruction) {
  switch (instruction.request_case()) {
    case v1::Instruction::kActivateCalibration:
      return RigOfChild(instruction.activate_calibration().name(),
                        "calibrations");
    case v1::Instruction::kUpdateRig:
      return ParseRigName(instruction.update_rig().rig().name());
    case v1::Instruction::kStartRecalibration:
      return ParseRigName(instruction.start_recalibration().parent());
    case v1::Instruction::kQuarantineSegments: {
      const std::string& parent = instruction.quarantine_segments().parent();
      return ParseRigName(parent);
    }
    case v1::Instruction::REQUEST_NOT_SET:
      break;
  }
  return std::nullopt;
}

std::string SerializeRequest(const v1::Instruction& instruction) {
  v1::Instruction request;
  const auto* reflection = instruction.GetReflection();
  const auto* oneof = instruction.GetDescriptor()->FindOneofByName(kRequest);
  if (const auto* field =
          reflection->GetOneofFieldDescriptor(instruction, oneof)) {
    reflection->MutableMessage(&request, field)
        ->CopyFrom(reflection->GetMessage(instruction, field));
  }
  return request.SerializeAsString();
}

}  // namespace selfcal::server
