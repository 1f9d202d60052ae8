#include "server/store/check.h"

#include <fmt/format.h>

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/status/status_macros.h"
#include "server/store/checksum.h"
#include "server/store/driver/statement.h"
#include "server/store/driver/transaction.h"
#include "server/store/payload.h"

namespace selfcal::server {
namespace {

// Findings of one check so far.
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

// A blob with a column beside it that has its checksum.
struct Checked {
  std::string table;
  std::string blob;
};

std::vector<Checked> CheckedBlobs(Connection* db, Findings* findings) {
  const auto columns = db->Columns();
  if (!columns.ok()) {
    findings->Add("schema", std::string(columns.status().message()));
    return {};
  }
  std::set<std::string> with_checksum;
  for (const Column& column : *columns) {
    if (column.name == "sha256" && column.type == db->dialect().blob_type) {
      with_checksum.insert(column.table);
    }
  }
  std::vector<Checked> checked;
  for (const Column& column : *columns) {
    if (with_checksum.contains(column.table) && column.name != "sha256" &&
        column.type == db->dialect().blob_type) {
      checked.push_back({column.table, column.name});
    }
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

}  // namespace

absl::StatusOr<CheckSummary> CheckDatabase(
    Connection* db, const StoreMaintenance::OnProblem& on_problem) {
  const Snapshot snapshot(db);
  SELFCAL_RETURN_IF_ERROR(snapshot.status());
  Findings findings(on_problem);
  findings.summary.bytes = db->Size().value_or(DatabaseSize()).bytes;
  db->CheckStructure([&](const StoreProblem& problem) {
    findings.Add(problem.place, problem.description);
    return !findings.cancelled();
  });
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
