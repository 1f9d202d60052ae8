#include "server/store/check.h"

#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

#include "server/store/checksum.h"
#include "server/store/payload.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

// What one check has found so far.
class Findings {
 public:
  explicit Findings(const StoreMaintenance::OnProblem& on_problem)
      : on_problem_(on_problem) {}

  void Add(std::string place, std::string description) {
    ++summary.problems;
    if (!cancelled_) {
      cancelled_ = !on_problem_({std::move(place), std::move(description)});
    }
  }
  bool cancelled() const { return cancelled_; }

  CheckSummary summary;

 private:
  const StoreMaintenance::OnProblem& on_problem_;
  bool cancelled_ = false;
};

// SQLite's own: of each page, record and index.
void CheckStructure(Connection* db, Findings* findings) {
  Statement check(db, "PRAGMA integrity_check(100)");
  while (!findings->cancelled() && check.Next()) {
    if (check.Text(0) != "ok") findings->Add("database", check.Text(0));
  }
  if (!check.status().ok()) {
    findings->Add("database", std::string(check.status().message()));
  }
}

void CheckReferences(Connection* db, Findings* findings) {
  Statement check(db, "PRAGMA foreign_key_check");
  while (!findings->cancelled() && check.Next()) {
    findings->Add(fmt::format("{}, row {}", check.Text(0), check.Int(1)),
                  fmt::format("refers to {} that is not there", check.Text(2)));
  }
  if (!check.status().ok()) {
    findings->Add("database", std::string(check.status().message()));
  }
}

// A blob and the column beside it with its checksum.
struct Checked {
  std::string table;
  std::string blob;
};

std::vector<Checked> CheckedBlobs(Connection* db, Findings* findings) {
  Statement read(db,
                 "SELECT t.name, b.name FROM sqlite_schema t "
                 "JOIN pragma_table_info(t.name) h "
                 "  ON h.name = 'sha256' AND h.type = 'BLOB' "
                 "JOIN pragma_table_info(t.name) b "
                 "  ON b.name <> 'sha256' AND b.type = 'BLOB' "
                 "WHERE t.type = 'table' ORDER BY t.name");
  std::vector<Checked> checked;
  while (read.Next()) checked.push_back({read.Text(0), read.Text(1)});
  if (!read.status().ok()) {
    findings->Add("schema", std::string(read.status().message()));
  }
  return checked;
}

void CheckBlobs(Connection* db, const Checked& what, Findings* findings) {
  Statement read(
      db, fmt::format("SELECT {}, sha256 FROM {}", what.blob, what.table));
  for (std::int64_t row = 1; !findings->cancelled() && read.Next(); ++row) {
    ++findings->summary.checksums;
    if (Sha256(read.Text(0)) != read.Text(1)) {
      findings->Add(fmt::format("{}, {} of row {}", what.table, what.blob, row),
                    "its checksum does not match");
    }
  }
  if (!read.status().ok()) {
    findings->Add(what.table, std::string(read.status().message()));
  }
}

void CheckPayloads(Connection* db, Findings* findings) {
  Statement read(db, "SELECT segment, data, raw_bytes, sha256 FROM payloads");
  while (!findings->cancelled() && read.Next()) {
    ++findings->summary.payloads;
    const std::string what = fmt::format("the data of segment {}", read.Int(0));
    const Payload payload{read.Text(1), read.Int(2), read.Text(3)};
    const absl::Status status = UnpackSegment(payload, what).status();
    if (!status.ok()) findings->Add(what, std::string(status.message()));
  }
  if (!read.status().ok()) {
    findings->Add("payloads", std::string(read.status().message()));
  }
}

std::int64_t Number(Connection* db, std::string_view sql) {
  Statement read(db, sql);
  return read.Next() ? read.Int(0) : 0;
}

}  // namespace

absl::StatusOr<CheckSummary> CheckDatabase(
    Connection* db, const StoreMaintenance::OnProblem& on_problem) {
  const Snapshot snapshot(db);
  SELFCAL_RETURN_IF_ERROR(snapshot.status());
  Findings findings(on_problem);
  findings.summary.bytes =
      Number(db, "PRAGMA page_count") * Number(db, "PRAGMA page_size");
  CheckStructure(db, &findings);
  CheckReferences(db, &findings);
  for (const Checked& what : CheckedBlobs(db, &findings)) {
    CheckBlobs(db, what, &findings);
  }
  CheckPayloads(db, &findings);
  if (findings.cancelled()) {
    return absl::CancelledError("the check was not waited for");
  }
  return findings.summary;
}

}  // namespace selfcal::server
