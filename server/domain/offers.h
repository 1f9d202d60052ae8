// Offers of scored segments to the tables (core/selection/tables.h).
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <vector>

#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "core/selection/joint_selection.h"
#include "core/selection/tables.h"
#include "server/store/segment_rows.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// The score of a group; null if there is none.
const GroupScore* FindGroup(const SegmentInformation& information,
                            const std::string& group);

// The decision of a joint selection about a segment, and the segments that its
// table held then, in order of arrival.
struct JointDecision {
  std::vector<SegmentKey> kept;
  JointChange change;
};

// Decides, and only reads: with hundreds of entries this takes too long for a
// transaction that writes. nullopt if the rig has no joint selection, or an
// entry is damaged.
absl::StatusOr<std::optional<JointDecision>> DecideJointly(
    UnitOfWork* tx,
    const SegmentKey& key,
    const SegmentInformation& information);

// Offers the segment to every table, writes the table updates, and records why
// a table does not hold it, or what it evicted. Returns the groups it entered.
// `decided` applies if the table still holds what it held then.
absl::StatusOr<std::vector<std::string>> OfferToTables(
    UnitOfWork* tx,
    const Rig& rig,
    const SegmentRow& segment,
    const SegmentInformation& information,
    const std::optional<JointDecision>& decided,
    std::vector<Table>* tables);

}  // namespace selfcal::server
