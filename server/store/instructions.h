// Records of instructions: what a hub has the device of a rig do.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "server/store/store.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

class Connection;  // driver/driver.h

// Newest first.
absl::StatusOr<Listed<StoredInstruction>> ListInstructionRows(
    Connection* db, const std::string& rig, const Page& page);

// --- Within a unit of work.

// Writes a pending instruction, and returns it with its number and time.
absl::StatusOr<StoredInstruction> InsertInstruction(UnitOfWork* tx,
                                                    const std::string& caller,
                                                    const std::string& request);
// Pending ones, oldest first.
absl::StatusOr<std::vector<StoredInstruction>> PendingInstructions(
    UnitOfWork* tx, int limit);
// Ends a pending instruction; another one stays as it is.
absl::Status EndInstruction(UnitOfWork* tx,
                            std::int64_t instruction,
                            InstructionState state,
                            const std::string& message);

}  // namespace selfcal::server
