// A database whose files were removed or replaced while it was in use.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "server/store/driver/statement.h"
#include "server/store/sqlite/open_database.h"
#include "server/store/sqlite/sqlite_database.h"
#include "test/promise.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

namespace fs = std::filesystem;

constexpr Migration kTable{
    "0001.sql", "aa", "CREATE TABLE t (x INTEGER) STRICT;"};

absl::StatusOr<std::unique_ptr<SqliteDatabase>> OpenTable(
    const std::string& path) {
  return SqliteDatabase::Open(path, [path] {
    return OpenDatabase(path, std::vector<Migration>{kTable}, 0);
  });
}

absl::Status Insert(SqliteDatabase* db) {
  return db->Write([](Connection* connection) {
    return Statement(connection, "INSERT INTO t VALUES (1)").Run();
  });
}

const std::pair<const char*, std::function<void(const fs::path&)>> kMoves[] = {
    {"the folder is removed",
     [](const fs::path& folder) { fs::remove_all(folder); }},
    {"the folder is renamed",
     [](const fs::path& folder) {
       fs::rename(folder, folder.parent_path() / "away");
     }},
    {"the folder is replaced by a copy",
     [](const fs::path& folder) {
       fs::rename(folder, folder.parent_path() / "away");
       fs::copy(folder.parent_path() / "away", folder);
     }},
    {"the database is removed",
     [](const fs::path& folder) { fs::remove(folder / "test.db"); }},
    {"the database is replaced by a copy",
     [](const fs::path& folder) {
       fs::copy_file(folder / "test.db", folder / "copy.db");
       fs::rename(folder / "copy.db", folder / "test.db");
     }},
    {"the log is removed",
     [](const fs::path& folder) { fs::remove(folder / "test.db-wal"); }},
};

TEST(MovedFiles, NothingIsAcknowledgedThatARestartWouldNotFind) {
  Promise promise("nothing is acknowledged into removed or replaced files");
  for (const auto& [what, move] : kMoves) {
    SCOPED_TRACE(what);
    const TempFolder parent;
    const fs::path folder = parent.path() / "state";
    fs::create_directory(folder);
    const auto db = OpenTable(folder / "test.db");
    ASSERT_TRUE(db.ok()) << db.status();
    ASSERT_TRUE(Insert(db->get()).ok());
    move(folder);
    for (int k = 0; k < 3; ++k) {
      const absl::Status stored = Insert(db->get());
      ++promise.trials;
      promise.lost += stored.ok();
      EXPECT_TRUE(absl::IsFailedPrecondition(stored)) << stored;
      EXPECT_THAT(std::string(stored.message()),
                  testing::HasSubstr("removed or replaced"));
    }
  }
}

TEST(MovedFiles, FilesThatStayAreNotTakenForMoved) {
  const TempFolder folder;
  for (int k = 0; k < 3; ++k) {
    const auto db = OpenTable(folder.File("test.db"));
    ASSERT_TRUE(db.ok()) << db.status();
    EXPECT_TRUE(
        (*db)->Write([](Connection*) { return absl::OkStatus(); }).ok());
    EXPECT_TRUE(Insert(db->get()).ok());
  }
}

}  // namespace
}  // namespace selfcal::server
