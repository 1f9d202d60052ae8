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
#include "server/store/calibrations.h"
#include "server/store/change_rows.h"
#include "server/store/driver/statement.h"
#include "server/store/estimates.h"
#include "server/store/events.h"
#include "server/store/inventory.h"
#include "server/store/records.h"
#include "server/store/report_check.h"
#include "server/store/reported_rows.h"
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

// The value of the column state.
constexpr std::int64_t Number(CalibrationState state) {
  return static_cast<std::int64_t>(state);
}
constexpr std::int64_t kActive = Number(CalibrationState::kActive);
constexpr std::int64_t kSuperseded = Number(CalibrationState::kSuperseded);
constexpr std::int64_t kRejected = Number(CalibrationState::kRejected);
constexpr std::int64_t kCandidate = Number(CalibrationState::kCandidate);
constexpr std::int64_t kRolledBack = Number(CalibrationState::kRolledBack);

absl::Status BadReport(const std::string& why) {
  return absl::InvalidArgumentError("the report cannot be read: " + why);
}

absl::Status Contradiction(const std::string& what) {
  return absl::FailedPreconditionError(
      fmt::format("the report contradicts the records of the hub: {}", what));
}

// The writing of the records of one report.
struct Application {
  UnitOfWork* tx;
  const AdmitData& admit_data;
  // The factory calibration, once it was read.
  std::optional<Calibration> factory = std::nullopt;
};

absl::Status ReadFactory(Application* to) {
  if (to->factory) return absl::OkStatus();
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig stored, ReadRig(to->tx));
  to->factory = stored.rig.factory;
  return absl::OkStatus();
}

// Names what was reported in an error of report_check.h.
absl::Status About(const std::string& what, const absl::Status& checked) {
  if (checked.ok()) return checked;
  return BadReport(fmt::format("{}: {}", what, std::string(checked.message())));
}

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

// The row of a table that has one for each record; null if it is not there.
const ReportedRow* RowOf(const Rows& rows, std::string_view table) {
  const auto found =
      std::find_if(rows.begin(), rows.end(), [&](const ReportedRow& row) {
        return row.table->name == table;
      });
  return found == rows.end() ? nullptr : &*found;
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

absl::Status ApplyRig(Application* to, const Rows& rows) {
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

absl::Status ApplySegment(Application* to,
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

absl::Status SetState(UnitOfWork* tx,
                      std::int64_t version,
                      std::int64_t state) {
  return Statement(tx->db(),
                   "UPDATE calibrations SET state = ?3 "
                   "WHERE rig = ?1 AND version = ?2 AND state <> ?3",
                   tx->rig_row(),
                   version,
                   state)
      .Run();
}

// Inserts a version as it began; what became of it follows from activations.
absl::Status InsertVersion(UnitOfWork* tx,
                           std::int64_t version,
                           const ReportedRow& row,
                           const Rows& rows) {
  std::optional<std::int64_t> run;
  if (row.Of("run").has_integer()) run = row.Of("run").integer();
  SELFCAL_RETURN_IF_ERROR(
      Statement(tx->db(),
                "INSERT INTO calibrations (rig, version, state, "
                "  create_time_ns, run, content, sha256, create_steady_ns) "
                "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
                tx->rig_row(),
                version,
                version == 1 ? kActive : kCandidate,
                row.Of("create_time_ns").integer(),
                run,
                BlobView{row.Of("content").blob()},
                BlobView{row.Of("sha256").blob()},
                row.Of("create_steady_ns").integer())
          .Run());
  for (const ReportedRow& origin : rows) {
    if (origin.table->name != "calibration_segments") continue;
    SELFCAL_RETURN_IF_ERROR(WriteRow(tx, origin, version, OnConflict::kKeep));
  }
  return absl::OkStatus();
}

absl::Status ApplyCalibration(Application* to,
                              const Record& record,
                              const Rows& rows) {
  UnitOfWork* const tx = to->tx;
  const std::int64_t version = record.number();
  const ReportedRow* row = RowOf(rows, "calibrations");
  if (row == nullptr) return BadReport("a calibration is gone");
  Statement before(tx->db(),
                   "SELECT sha256, state FROM calibrations "
                   "WHERE rig = ?1 AND version = ?2",
                   tx->rig_row(),
                   version);
  const bool is_there = before.Next();
  SELFCAL_RETURN_IF_ERROR(before.status());
  if (!is_there) {
    SELFCAL_RETURN_IF_ERROR(InsertVersion(tx, version, *row, rows));
  } else if (before.Text(0) != row->Of("sha256").blob()) {
    return Contradiction(fmt::format("version {} differs", version));
  }
  const bool is_candidate =
      is_there ? before.Int(1) == kCandidate : version != 1;
  if (is_candidate && row->Of("state").integer() == kRejected) {
    SELFCAL_RETURN_IF_ERROR(SetState(tx, version, kRejected));
  }
  for (const ReportedRow& more : rows) {
    if (more.table->name != "validations" &&
        more.table->name != "disagreements") {
      continue;
    }
    SELFCAL_RETURN_IF_ERROR(WriteRow(tx, more, version, OnConflict::kKeep));
    if (more.table->name == "disagreements") {
      SELFCAL_RETURN_IF_ERROR(AnnounceCalibration(tx));
    }
  }
  SELFCAL_ASSIGN_OR_RETURN(const StoredCalibration written,
                           ReadCalibration(tx, version));
  SELFCAL_RETURN_IF_ERROR(ReadFactory(to));
  const std::string what = fmt::format("version {}", version);
  SELFCAL_RETURN_IF_ERROR(
      About(what, CheckReportedTime(written.create_time_ns)));
  SELFCAL_RETURN_IF_ERROR(About(what, CheckReported(written, *to->factory)));
  return is_there ? absl::OkStatus() : InsertEstimates(tx, written);
}

absl::Status ApplyActivation(UnitOfWork* tx,
                             const Record& record,
                             const Rows& rows) {
  const ReportedRow* row = RowOf(rows, "activations");
  if (row == nullptr) return BadReport("an activation is gone");
  SELFCAL_RETURN_IF_ERROR(
      About("an activation", CheckReportedTime(row->Of("time_ns").integer())));
  const std::int64_t version = row->Of("version").integer();
  Statement before(tx->db(),
                   "SELECT version FROM activations "
                   "WHERE rig = ?1 AND activation = ?2",
                   tx->rig_row(),
                   record.number());
  const bool is_there = before.Next();
  SELFCAL_RETURN_IF_ERROR(before.status());
  if (is_there) {
    if (before.Int(0) == version) return absl::OkStatus();
    return Contradiction(fmt::format("activation {} differs", record.number()));
  }
  SELFCAL_ASSIGN_OR_RETURN(
      const std::int64_t newest,
      ReadInt(tx->db(),
              "SELECT coalesce(max(activation), 0) FROM activations "
              "WHERE rig = ?1",
              tx->rig_row()));
  if (record.number() != newest + 1) {
    return Contradiction(fmt::format("activation {} is missing", newest + 1));
  }
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t active, ActiveVersion(tx));
  if (active != version) {
    SELFCAL_RETURN_IF_ERROR(
        SetState(tx, active, version < active ? kRolledBack : kSuperseded));
    SELFCAL_RETURN_IF_ERROR(SetState(tx, version, kActive));
  }
  SELFCAL_RETURN_IF_ERROR(
      WriteRow(tx, *row, record.number(), OnConflict::kKeep));
  return AnnounceCalibration(tx);
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
absl::Status ApplyData(Application* to,
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
        to->admit_data(static_cast<std::int64_t>(data.size())));
    if (!admitted) continue;
    SELFCAL_RETURN_IF_ERROR(
        WriteRow(to->tx, row, record.number(), OnConflict::kUpdate));
  }
  return absl::OkStatus();
}

absl::Status ApplyRecord(Application* to,
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
      return ApplyCalibration(to, record, rows);
    case RecordKind::kActivation:
      return ApplyActivation(tx, record, rows);
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

// Returns the newest attempt.
absl::StatusOr<std::int64_t> PutEndOfReports(Connection* db,
                                             std::int64_t key,
                                             std::int64_t attempt,
                                             std::int64_t now_ns) {
  return InsertReturning(
      db,
      "INSERT INTO ended_reports AS e (device, attempt, time_ns) "
      "VALUES (?1, ?2, ?3) ON CONFLICT (device) DO UPDATE SET "
      "  attempt = CASE WHEN e.attempt < ?2 THEN ?2 ELSE e.attempt END, "
      "  time_ns = ?3 "
      "RETURNING attempt",
      key,
      attempt,
      now_ns);
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

absl::StatusOr<std::optional<ReportingDevice>> ReadReportingDevice(
    UnitOfWork* tx) {
  Statement read(tx->db(),
                 "SELECT device, report, attempt, time_ns, waiting, "
                 "  program_version "
                 "FROM reported_rigs WHERE rig = ?1",
                 tx->rig_row());
  std::optional<ReportingDevice> device;
  if (read.Next()) {
    device = {read.Int(0),
              read.Int(1),
              read.Int(2),
              read.Int(3),
              read.Int(4),
              read.Text(5)};
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  return device;
}

absl::StatusOr<std::optional<Calibration>> FactoryIfReported(
    Connection* db, const std::string& rig) {
  SELFCAL_ASSIGN_OR_RETURN(const std::int64_t rig_row, FindRigId(db, rig));
  UnitOfWork tx(db, rig, rig_row, 0);
  SELFCAL_ASSIGN_OR_RETURN(const auto device, ReadReportingDevice(&tx));
  if (!device) return std::nullopt;
  SELFCAL_ASSIGN_OR_RETURN(StoredRig stored, ReadRig(&tx));
  return std::move(stored.rig.factory);
}

absl::Status WriteReportingDevice(UnitOfWork* tx,
                                  const ReportingDevice& device) {
  return Statement(
             tx->db(),
             "INSERT INTO reported_rigs (rig, device, report, attempt, "
             "  time_ns, waiting, program_version) "
             "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7) "
             "ON CONFLICT (rig) DO UPDATE SET device = ?2, report = ?3, "
             "  attempt = ?4, time_ns = ?5, waiting = ?6, program_version = ?7",
             tx->rig_row(),
             device.key,
             device.report,
             device.attempt,
             device.time_ns,
             device.waiting,
             device.program_version)
      .Run();
}

absl::StatusOr<std::int64_t> ReadEndOfReports(UnitOfWork* tx,
                                              std::int64_t key) {
  // Writes, so that a concurrent report of the deletion waits for this unit of
  // work.
  return PutEndOfReports(tx->db(), key, 0, tx->time_ns());
}

absl::Status ForgetEndOfReports(UnitOfWork* tx, std::int64_t key) {
  return Statement(tx->db(), "DELETE FROM ended_reports WHERE device = ?1", key)
      .Run();
}

absl::Status WriteEndOfReports(Connection* db,
                               std::int64_t key,
                               std::int64_t attempt,
                               std::int64_t now_ns) {
  SELFCAL_RETURN_IF_ERROR(Statement(db,
                                    "DELETE FROM ended_reports "
                                    "WHERE time_ns < ?1",
                                    now_ns - kEndOfReportsKept_ns)
                              .Run());
  return PutEndOfReports(db, key, attempt, now_ns).status();
}

absl::Status ApplyReport(UnitOfWork* tx,
                         const std::string& bytes,
                         const AdmitData& admit_data) {
  SELFCAL_ASSIGN_OR_RETURN(const auto records, Parse(bytes));
  Application application{tx, admit_data};
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
