// Offers of scored segments to the tables (core/selection/tables.h).
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "core/selection/tables.h"
#include "server/store/segment_rows.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// The score of a group; null if there is none.
const GroupScore* FindGroup(const SegmentInformation& information,
                            const std::string& group);

// Offers the segment to every table, writes the table updates, and records why
// a table does not hold it, or what it evicted. Returns the groups it entered.
absl::StatusOr<std::vector<std::string>> OfferToTables(
    UnitOfWork* tx,
    const Rig& rig,
    const SegmentRow& segment,
    const SegmentInformation& information,
    std::vector<Table>* tables);

}  // namespace selfcal::server
