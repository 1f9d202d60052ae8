#include "server/encode/encode_instruction.h"

#include <fmt/format.h>

#include "proto/resource_names.h"
#include "server/encode/set_time.h"

namespace selfcal::server {
namespace {

v1::Instruction::State EncodeInstructionState(InstructionState state) {
  switch (state) {
    case InstructionState::kPending:
      return v1::Instruction::PENDING;
    case InstructionState::kDone:
      return v1::Instruction::DONE;
    case InstructionState::kRefused:
      return v1::Instruction::REFUSED;
  }
  return v1::Instruction::PENDING;
}

// The field of its request; null if it has none.
const google::protobuf::FieldDescriptor* FieldOf(
    const v1::Instruction& instruction) {
  return instruction.GetReflection()->GetOneofFieldDescriptor(
      instruction, instruction.GetDescriptor()->FindOneofByName("request"));
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
  message.set_state(EncodeInstructionState(instruction.state));
  message.set_message(instruction.message);
  if (instruction.end_time_ns != 0) {
    SetTime(instruction.end_time_ns, message.mutable_end_time());
  }
  return message;
}

const google::protobuf::Message* RequestOf(const v1::Instruction& instruction) {
  const auto* field = FieldOf(instruction);
  return field == nullptr
             ? nullptr
             : &instruction.GetReflection()->GetMessage(instruction, field);
}

std::string SerializeRequest(const v1::Instruction& instruction) {
  v1::Instruction request;
  if (const auto* field = FieldOf(instruction)) {
    request.GetReflection()
        ->MutableMessage(&request, field)
        ->CopyFrom(*RequestOf(instruction));
  }
  return request.SerializeAsString();
}

}  // namespace selfcal::server
