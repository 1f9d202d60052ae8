#include "server/store/rigs.h"

#include <fmt/format.h>

#include "server/store/checksum.h"
#include "server/store/paging.h"
#include "server/store/records.h"
#include "server/store/statement.h"
#include "server/store/status_macros.h"

namespace selfcal::server {
namespace {

constexpr char kList[] = "rigs";

absl::Status NoSuchRig(const std::string& rig) {
  return absl::NotFoundError(
      fmt::format("rig {} does not exist; create it first", rig));
}

// From columns id, create_time_ns, definition, sha256, starting at `column`.
absl::StatusOr<StoredRig> RigFromRow(const Statement& row, int column) {
  const std::string what = "rig " + row.Text(column);
  const std::string bytes = row.Text(column + 2);
  SELFCAL_RETURN_IF_ERROR(VerifySha256(bytes, row.Text(column + 3), what));
  StoredRig stored;
  SELFCAL_ASSIGN_OR_RETURN(stored, ParseRig(bytes, what));
  stored.create_time_ns = row.Int(column + 1);
  return stored;
}

absl::StatusOr<std::vector<std::string>> ReadNames(Statement* read) {
  std::vector<std::string> names;
  while (read->Next()) names.push_back(read->Text(0));
  SELFCAL_RETURN_IF_ERROR(read->status());
  return names;
}

}  // namespace

absl::StatusOr<std::int64_t> InsertRig(Connection* db, const StoredRig& rig) {
  const std::string& id = rig.rig.id;
  Statement existing(db, "SELECT 1 FROM rigs WHERE id = ?1", id);
  const bool exists = existing.Next();
  SELFCAL_RETURN_IF_ERROR(existing.status());
  if (exists) {
    return absl::AlreadyExistsError(
        fmt::format("rig {} exists; choose another name", id));
  }
  const std::string bytes = SerializeRig(rig);
  const std::string sha256 = Sha256(bytes);
  SELFCAL_RETURN_IF_ERROR(
      Statement(db,
                "INSERT INTO rigs (id, create_time_ns, definition, sha256) "
                "VALUES (?1, ?2, ?3, ?4)",
                id,
                rig.create_time_ns,
                BlobView{bytes},
                BlobView{sha256})
          .Run());
  return LastInsertedRow(db);
}

absl::StatusOr<std::int64_t> FindRigId(Connection* db, const std::string& rig) {
  Statement read(db, "SELECT rig FROM rigs WHERE id = ?1", rig);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return NoSuchRig(rig);
  }
  return read.Int(0);
}

absl::StatusOr<StoredRig> ReadRig(Connection* db, const std::string& rig) {
  Statement read(db,
                 "SELECT id, create_time_ns, definition, sha256 "
                 "FROM rigs WHERE id = ?1",
                 rig);
  const bool found = read.Next();
  SELFCAL_RETURN_IF_ERROR(read.status());
  if (!found) {
    return NoSuchRig(rig);
  }
  return RigFromRow(read, 0);
}

absl::StatusOr<StoredRig> ReadRig(UnitOfWork* tx) {
  return ReadRig(tx->db(), tx->rig());
}

absl::StatusOr<std::int64_t> CountRigs(UnitOfWork* tx) {
  Statement read(tx->db(), "SELECT COUNT(*) FROM rigs");
  const std::int64_t rigs = read.Next() ? read.Int(0) : 0;
  if (!read.status().ok()) return read.status();
  return rigs;
}

absl::StatusOr<std::vector<std::string>> RigNames(Connection* db) {
  Statement read(db, "SELECT id FROM rigs ORDER BY rig");
  return ReadNames(&read);
}

absl::StatusOr<std::vector<std::string>> IdleRigNames(
    Connection* db, std::int64_t idle_since_ns) {
  Statement read(db,
                 "SELECT id FROM rigs WHERE last_seen_ns > 0 "
                 "AND last_seen_ns <= ?1 ORDER BY rig",
                 idle_since_ns);
  return ReadNames(&read);
}

absl::StatusOr<Listed<StoredRig>> ListRigRows(Connection* db,
                                              const Page& page) {
  SELFCAL_ASSIGN_OR_RETURN(const auto after, PageKey(kList, page));
  const int size = PageSize(page);
  Statement read(db,
                 "SELECT id, create_time_ns, definition, sha256 "
                 "FROM rigs WHERE id > ?1 ORDER BY id LIMIT ?2",
                 after.value_or(""),
                 size + 1);
  Listed<StoredRig> listed;
  while (read.Next()) {
    SELFCAL_ASSIGN_OR_RETURN(StoredRig stored, RigFromRow(read, 0));
    listed.items.push_back(std::move(stored));
  }
  SELFCAL_RETURN_IF_ERROR(read.status());
  CutPage(
      kList, size, [](const auto& item) { return item.rig.id; }, &listed);
  return listed;
}

}  // namespace selfcal::server
