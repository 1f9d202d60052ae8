#include "server/store/inventory.h"

#include <cstdint>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"
#include "server/store/record_kind.h"
#include "server/store/segment_rows.h"

namespace selfcal::server {
namespace {

absl::StatusOr<std::vector<std::int64_t>> SequencesOf(UnitOfWork* tx) {
  Statement read(tx->db(),
                 "SELECT sequence FROM segments WHERE rig = ?1 "
                 "ORDER BY sequence",
                 tx->rig_row());
  std::vector<std::int64_t> sequences;
  while (read.Next()) sequences.push_back(read.Int(0));
  SELFCAL_RETURN_IF_ERROR(read.status());
  return sequences;
}

}  // namespace

// A row is a range of sequences: its first and its last.
absl::Status PutInventory(UnitOfWork* tx, store::ReportedRecords* records) {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::int64_t> sequences,
                           SequencesOf(tx));
  auto* record = records->add_records();
  record->set_kind(static_cast<int>(RecordKind::kInventory));
  for (std::size_t k = 0; k < sequences.size(); ++k) {
    if (k == 0 || sequences[k] != sequences[k - 1] + 1) {
      auto* row = record->add_rows();
      row->add_values()->set_integer(sequences[k]);
      row->add_values();
    }
    auto* row = record->mutable_rows(record->rows_size() - 1);
    row->mutable_values(1)->set_integer(sequences[k]);
  }
  return absl::OkStatus();
}

absl::Status ApplyInventory(UnitOfWork* tx,
                            const store::ReportedRecords::Record& record) {
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<std::int64_t> sequences,
                           SequencesOf(tx));
  int range = 0;
  for (const std::int64_t sequence : sequences) {
    while (range < record.rows_size()) {
      if (record.rows(range).values_size() != 2) {
        return absl::InvalidArgumentError("the inventory of a report is bad");
      }
      if (record.rows(range).values(1).integer() >= sequence) break;
      ++range;
    }
    const bool present = range < record.rows_size() &&
                         record.rows(range).values(0).integer() <= sequence;
    if (!present) SELFCAL_RETURN_IF_ERROR(DeleteSegmentAlone(tx, sequence));
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
