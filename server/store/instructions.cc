#include "server/store/instructions.h"

#include <fmt/format.h>

#include <utility>

#include "server/status/status_macros.h"
#include "server/store/checksum.h"
#include "server/store/driver/statement.h"
#include "server/store/paging.h"
#include "server/store/rigs.h"

namespace selfcal::server {
namespace {

constexpr char kColumns[] =
    "SELECT instruction, create_time_ns, caller, request, sha256, state, "
    "  message, end_time_ns FROM instructions ";

absl::StatusOr<std::vector<StoredInstruction>> ReadAll(const std::string& rig,
                                                       Statement* read) {
  std::vector<StoredInstruction> instructions;
  while (read->Next()) {
    StoredInstruction& instruction = instructions.emplace_back();
    instruction.rig = rig;
    instruction.instruction = read->Int(0);
    instruction.create_time_ns = read->Int(1);
    instruction.caller = read->Text(2);
    instruction.request = read->Text(3);
    SELFCAL_RETURN_IF_ERROR(VerifySha256(
        instruction.request,
        read->Text(4),
        fmt::format(
            "instruction {} for rig {}", instruction.instruction, rig)));
    instruction.state = static_cast<InstructionState>(read->Int(5));
    instruction.message = read->Text(6);
    instruction.end_time_ns = read->Int(7);
  }
  SELFCAL_RETURN_IF_ERROR(read->status());
  return instructions;
}

}  // namespace

absl::StatusOr<Listed<StoredInstruction>> ListInstructionRows(
    Connection* db, const std::string& rig, const Page& page) {
  const std::string list = "instructions/" + rig;
  SELFCAL_ASSIGN_OR_RETURN(const auto before, PageNumber(list, page));
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t row, FindRigId(db, rig));
  const int size = PageSize(page);
  Statement read(db,
                 std::string(kColumns) +
                     "WHERE rig = ?1 AND instruction < ?2 "
                     "ORDER BY instruction DESC LIMIT ?3",
                 row,
                 before.value_or(INT64_MAX),
                 size + 1);
  Listed<StoredInstruction> listed;
  SELFCAL_ASSIGN_OR_RETURN(listed.items, ReadAll(rig, &read));
  CutPage(
      list, size, [](const auto& item) { return item.instruction; }, &listed);
  return listed;
}

absl::StatusOr<StoredInstruction> InsertInstruction(
    UnitOfWork* tx, const std::string& caller, const std::string& request) {
  StoredInstruction instruction;
  instruction.rig = tx->rig();
  instruction.create_time_ns = tx->time_ns();
  instruction.caller = caller;
  instruction.request = request;
  const std::string sha256 = Sha256(request);
  SELFCAL_ASSIGN_OR_RETURN(
      instruction.instruction,
      InsertReturning(
          tx->db(),
          "INSERT INTO instructions (rig, instruction, create_time_ns, "
          "  caller, request, sha256, state) "
          "VALUES (?1, (SELECT coalesce(max(instruction), 0) + 1 "
          "  FROM instructions WHERE rig = ?1), ?2, ?3, ?4, ?5, 1) "
          "RETURNING instruction",
          tx->rig_row(),
          instruction.create_time_ns,
          caller,
          BlobView{request},
          BlobView{sha256}));
  return instruction;
}

absl::StatusOr<std::vector<StoredInstruction>> PendingInstructions(
    UnitOfWork* tx, int limit) {
  Statement read(tx->db(),
                 std::string(kColumns) +
                     "WHERE rig = ?1 AND state = 1 "
                     "ORDER BY instruction LIMIT ?2",
                 tx->rig_row(),
                 limit);
  return ReadAll(tx->rig(), &read);
}

absl::Status EndInstruction(UnitOfWork* tx,
                            std::int64_t instruction,
                            InstructionState state,
                            const std::string& message) {
  return Statement(tx->db(),
                   "UPDATE instructions SET state = ?3, message = ?4, "
                   "  end_time_ns = ?5 "
                   "WHERE rig = ?1 AND instruction = ?2 AND state = 1",
                   tx->rig_row(),
                   instruction,
                   static_cast<int>(state),
                   message,
                   tx->time_ns())
      .Run();
}

}  // namespace selfcal::server
