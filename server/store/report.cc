#include "server/store/report.h"

#include <fmt/format.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/change/aged.h"
#include "core/model/calibration.h"
#include "core/model/rig.h"
#include "proto/label_text.h"
#include "proto/parsed_size.h"
#include "selfcal/store/report.pb.h"
#include "server/status/status_macros.h"
#include "server/store/announcements.h"
#include "server/store/change_rows.h"
#include "server/store/driver/statement.h"
#include "server/store/events.h"
#include "server/store/inventory.h"
#include "server/store/records.h"
#include "server/store/report_application.h"
#include "server/store/report_check.h"
#include "server/store/reported_rows.h"
#include "server/store/reported_versions.h"
#include "server/store/rigs.h"
#include "server/store/runs.h"
#include "server/store/segment_rows.h"

namespace selfcal::server {
namespace {

using Record = store::ReportedRecords::Record;
using Rows = std::vector<ReportedRow>;

// A message of data beyond this is not taken, as it could not be read here, nor
// are records that would take more once they are parsed.
constexpr std::int64_t kMaxReportedBytes = std::int64_t{256} << 20;

absl::StatusOr<store::ReportedRecords> Parse(const std::string& bytes) {
  store::ReportedRecords records;
  if (ParsedSizeOfRecords(bytes) > kMaxReportedBytes) {
    return BadReport("its records would take too much memory");
  }
  if (!records.ParseFromString(bytes)) {
    return BadReport("its records are no message of this kind");
  }
  return records;
}

// Writes the rows, in place of those that the record had. The tables come in an
// order in which none refers to a later one, and the first has one row for each
// record: it is updated.
absl::Status ReplaceRows(UnitOfWork* tx,
                         const Record& record,
                         const Rows& rows) {
  bool is_first = true;
  for (const ReportedTable& table : ReportedTables()) {
    if (static_cast<int>(table.kind) != record.kind()) continue;
    if (!is_first) {
      SELFCAL_RETURN_IF_ERROR(DeleteRows(tx, table, record.number()));
    }
    is_first = false;
  }
  for (const ReportedRow& row : rows) {
    SELFCAL_RETURN_IF_ERROR(
        WriteRow(tx, row, record.number(), OnConflict::kUpdate));
  }
  return absl::OkStatus();
}

// Against the rules in rig.proto.
absl::Status CheckLabels(const StoredRig& rig) {
  for (const auto& [name, value] : rig.labels) {
    if (!IsLabelName(name)) return BadReport("a label has no name of a label");
    if (!IsLabelValue(value)) {
      return BadReport(fmt::format("the label {} has no value of one", name));
    }
  }
  return absl::OkStatus();
}

absl::Status ApplyRig(ReportApplication* to, const Rows& rows) {
  UnitOfWork* const tx = to->tx;
  const ReportedRow* row = RowOf(rows, "rigs");
  if (row == nullptr) return BadReport("a rig has no definition");
  SELFCAL_RETURN_IF_ERROR(
      About("the rig", CheckReportedTime(row->Of("create_time_ns").integer())));
  SELFCAL_RETURN_IF_ERROR(ReadFactory(to));
  SELFCAL_RETURN_IF_ERROR(Statement(tx->db(),
                                    "UPDATE rigs SET create_time_ns = ?2, "
                                    "  definition = ?3, sha256 = ?4 "
                                    "WHERE rig = ?1",
                                    tx->rig_row(),
                                    row->Of("create_time_ns").integer(),
                                    BlobView{row->Of("definition").blob()},
                                    BlobView{row->Of("sha256").blob()})
                              .Run());
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig stored, ReadRig(tx));
  if (stored.rig.id != tx->rig()) {
    return BadReport(fmt::format("it defines the rig {}", stored.rig.id));
  }
  // All that is stored was computed with it.
  if (!SameShape(stored.rig.factory, *to->factory)) {
    return Contradiction("the rig has other sensors or parameters");
  }
  to->factory = stored.rig.factory;
  std::vector<Violation> violations = Validate(stored.rig);
  if (violations.empty()) {
    violations = Validate(stored.rig, stored.policy.walk_densities);
  }
  if (!violations.empty()) {
    return BadReport(fmt::format("{} of the rig {}",
                                 violations.front().field,
                                 violations.front().message));
  }
  SELFCAL_RETURN_IF_ERROR(CheckLabels(stored));
  // Grants depend on labels: those of the definition, whatever the rows say.
  return WriteLabels(tx, stored);
}

// Deletes the segment that has this key and another number: the device has
// deleted it, and got the segment again.
absl::Status DeleteOther(UnitOfWork* tx,
                         const SegmentKey& key,
                         std::int64_t number) {
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t other,
      ReadInt(tx->db(),
              "SELECT coalesce(max(sequence), 0) FROM segments WHERE rig = ?1 "
              "AND session = ?2 AND session_index = ?3 AND sequence <> ?4",
              tx->rig_row(),
              key.session,
              key.index,
              number));
  return other == 0 ? absl::OkStatus() : DeleteSegmentAlone(tx, other);
}

absl::Status ApplySegment(ReportApplication* to,
                          const Record& record,
                          const Rows& rows) {
  UnitOfWork* const tx = to->tx;
  const ReportedRow* row = RowOf(rows, "segments");
  if (row == nullptr) return DeleteSegmentAlone(tx, record.number());
  SELFCAL_RETURN_IF_ERROR(About(
      "a segment", CheckReportedTime(row->Of("receive_time_ns").integer())));
  const SegmentKey key{row->Of("session").text(),
                       row->Of("session_index").integer()};
  Statement before(tx->db(),
                   "SELECT session, session_index FROM segments "
                   "WHERE rig = ?1 AND sequence = ?2",
                   tx->rig_row(),
                   record.number());
  const bool another =
      before.Next() && SegmentKey{before.Text(0), before.Int(1)} != key;
  SELFCAL_RETURN_IF_ERROR(before.status());
  // The last segment was deleted, and another one took its number.
  if (another) SELFCAL_RETURN_IF_ERROR(DeleteSegmentAlone(tx, record.number()));
  SELFCAL_RETURN_IF_ERROR(DeleteOther(tx, key, record.number()));
  SELFCAL_RETURN_IF_ERROR(ReplaceRows(tx, record, rows));
  SELFCAL_RETURN_IF_ERROR(Statement(tx->db(),
                                    "UPDATE rigs SET last_seen_ns = ?2 "
                                    "WHERE rig = ?1 AND last_seen_ns < ?2",
                                    tx->rig_row(),
                                    row->Of("receive_time_ns").integer())
                              .Run());
  SELFCAL_ASSIGN_OR_RETURN(const StoredSegment written, ReadSegment(tx, key));
  if (!written.information) return absl::OkStatus();
  SELFCAL_RETURN_IF_ERROR(ReadFactory(to));
  return About(SegmentText(tx->rig(), key),
               CheckReported(*written.information, *to->factory));
}

absl::Status ApplyRun(UnitOfWork* tx, const Record& record, const Rows& rows) {
  if (rows.empty()) return BadReport("a run is gone");
  SELFCAL_RETURN_IF_ERROR(ReplaceRows(tx, record, rows));
  SELFCAL_ASSIGN_OR_RETURN(const StoredRun written,
                           ReadRun(tx, record.number()));
  for (const std::int64_t time_ns :
       {written.create_time_ns, written.end_time_ns}) {
    SELFCAL_RETURN_IF_ERROR(About("a run", CheckReportedTime(time_ns)));
  }
  return AnnounceRun(tx, record.number());
}

absl::Status ApplyEvent(UnitOfWork* tx,
                        const Record& record,
                        const Rows& rows) {
  const ReportedRow* row = RowOf(rows, "events");
  if (row == nullptr) return BadReport("an event is gone");
  SELFCAL_RETURN_IF_ERROR(
      About("an event", CheckReportedTime(row->Of("time_ns").integer())));
  return InsertReportedEvent(tx,
                             {record.number(),
                              row->Of("time_ns").integer(),
                              tx->rig(),
                              static_cast<EventKind>(row->Of("kind").integer()),
                              row->Of("detail").text(),
                              row->Of("steady_ns").integer()});
}

// Data that the device does not have any more stays. It is checked where it is
// read (Store::GetSegmentData).
absl::Status ApplyData(ReportApplication* to,
                       const Record& record,
                       const Rows& rows) {
  for (const ReportedRow& row : rows) {
    const std::string& data = row.Of("data").blob();
    const std::int64_t raw_bytes = row.Of("raw_bytes").integer();
    if (raw_bytes < 0 || raw_bytes > kMaxReportedBytes) {
      return BadReport("the data of a segment is too large");
    }
    SELFCAL_ASSIGN_OR_RETURN(
        const bool admitted,
        to->rules.admit_data(static_cast<std::int64_t>(data.size())));
    if (!admitted) continue;
    SELFCAL_RETURN_IF_ERROR(
        WriteRow(to->tx, row, record.number(), OnConflict::kUpdate));
  }
  return absl::OkStatus();
}

absl::Status ApplyRecord(ReportApplication* to,
                         const Record& record,
                         const Rows& rows) {
  UnitOfWork* const tx = to->tx;
  switch (static_cast<RecordKind>(record.kind())) {
    case RecordKind::kRig:
      return ApplyRig(to, rows);
    case RecordKind::kTables:
      return ReplaceRows(tx, record, rows);
    case RecordKind::kSegment:
      return ApplySegment(to, record, rows);
    case RecordKind::kRun:
      return ApplyRun(tx, record, rows);
    case RecordKind::kCalibration:
      return ApplyCalibration(to, record.number(), rows);
    case RecordKind::kActivation:
      return ApplyActivation(to, record.number(), rows);
    case RecordKind::kChange: {
      if (rows.empty()) return BadReport("a device change is gone");
      SELFCAL_RETURN_IF_ERROR(ReplaceRows(tx, record, rows));
      SELFCAL_RETURN_IF_ERROR(ReadChange(tx, record.number()).status());
      return AnnounceCalibration(tx);
    }
    case RecordKind::kEvent:
      return ApplyEvent(tx, record, rows);
    case RecordKind::kData:
      return ApplyData(to, record, rows);
    case RecordKind::kInventory:
      return ApplyInventory(tx, record);
  }
  return absl::InvalidArgumentError(
      fmt::format("this hub does not know records of kind {}: upgrade the hub "
                  "before its devices",
                  record.kind()));
}

// What the device wrote is not what it should be, rather than the disk here; or
// the schema refuses it.
absl::Status FromDevice(const absl::Status& status) {
  if (absl::IsDataLoss(status) || absl::IsNotFound(status)) {
    return BadReport(std::string(status.message()));
  }
  if (absl::IsInternal(status)) {
    return Contradiction(std::string(status.message()));
  }
  return status;
}

}  // namespace

std::int64_t ParsedSizeOfRecords(const std::string& records) {
  google::protobuf::io::ArrayInputStream stream(
      records.data(), static_cast<int>(records.size()));
  return ParsedSize(*store::ReportedRecords::descriptor(), &stream);
}

absl::StatusOr<StoredRig> RigOfReport(const std::string& bytes,
                                      const std::string& rig) {
  SELFCAL_ASSIGN_OR_RETURN(const auto records, Parse(bytes));
  for (const Record& record : records.records()) {
    if (record.kind() != static_cast<int>(RecordKind::kRig)) continue;
    SELFCAL_ASSIGN_OR_RETURN(const Rows rows, CheckRows(records, record));
    const ReportedRow* row = RowOf(rows, "rigs");
    if (row == nullptr) break;
    auto stored = ParseRig(row->Of("definition").blob(), "the rig");
    if (!stored.ok()) return FromDevice(stored.status());
    if (stored->rig.id != rig) {
      return BadReport(fmt::format("it defines the rig {}", stored->rig.id));
    }
    stored->create_time_ns = row->Of("create_time_ns").integer();
    return stored;
  }
  return BadReport("it begins without the definition of the rig");
}

absl::Status ApplyReport(UnitOfWork* tx,
                         const std::string& bytes,
                         const ReportRules& rules) {
  SELFCAL_ASSIGN_OR_RETURN(const auto records, Parse(bytes));
  ReportApplication application{tx, rules};
  for (const Record& record : records.records()) {
    // The rows of an inventory are of no table.
    Rows rows;
    if (record.kind() != static_cast<int>(RecordKind::kInventory)) {
      SELFCAL_ASSIGN_OR_RETURN(rows, CheckRows(records, record));
    }
    const absl::Status status = ApplyRecord(&application, record, rows);
    if (!status.ok()) return FromDevice(status);
  }
  return absl::OkStatus();
}

}  // namespace selfcal::server
