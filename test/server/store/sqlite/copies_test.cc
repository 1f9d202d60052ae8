// Backup and restore of an SQLite file beside a store that is in use.
#include <atomic>
#include <filesystem>
#include <set>
#include <thread>
#include <utility>

#include "server/store/checksum.h"
#include "server/store/maintenance.h"
#include "test/promise.h"
#include "test/server/store/fixture_content.h"
#include "test/server/store/sqlite/sqlite_test.h"
#include "test/support/files.h"

namespace selfcal::server {
namespace {

namespace fs = std::filesystem;

class CopiesTest : public SqliteTest {
 protected:
  CopiesTest() {
    EXPECT_TRUE(Open().ok());
    EXPECT_TRUE(WriteFixture(store_.get()));
  }

  std::string BackUp() {
    std::string bytes;
    const auto summary =
        store_->maintenance()->Backup([&](std::string_view piece) {
          bytes += piece;
          return true;
        });
    EXPECT_TRUE(summary.ok()) << summary.status();
    if (summary.ok()) {
      EXPECT_EQ(summary->bytes, static_cast<std::int64_t>(bytes.size()));
      EXPECT_EQ(summary->sha256, Sha256(bytes));
    }
    return bytes;
  }

  absl::StatusOr<std::string> Restore(const std::string& bytes,
                                      const std::string& sha256) {
    auto restoration = store_->maintenance()->BeginRestore();
    if (!restoration.ok()) return restoration.status();
    for (std::size_t at = 0; at < bytes.size(); at += 100'000) {
      const absl::Status status =
          (*restoration)->Append(std::string_view(bytes).substr(at, 100'000));
      if (!status.ok()) return status;
    }
    return (*restoration)->Finish(sha256, /*time_ns=*/7'000'000'000);
  }

  void Reopen() {
    store_.reset();
    const absl::Status opened = Open();
    ASSERT_TRUE(opened.ok()) << opened;
  }
};

// SQLite reads on under the name that it finds.
TEST_F(CopiesTest, ADamagedNameInTheSchemaIsFound) {
  store_.reset();
  const absl::Status damaged = ExecuteInFile(
      Path(),
      "PRAGMA writable_schema = ON; UPDATE sqlite_schema SET sql = "
      "  replace(sql, 'imu_samples', 'imu_sampleq') WHERE name = 'segments'");
  ASSERT_TRUE(damaged.ok()) << damaged;
  ASSERT_TRUE(Open().ok());
  std::vector<std::string> found;
  const auto summary =
      store_->maintenance()->Check([&](const StoreProblem& problem) {
        found.push_back(problem.place + ": " + problem.description);
        return true;
      });
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_THAT(found,
              ::testing::ElementsAre("schema: table segments, imu_samples of "
                                     "type INTEGER is not there"));
}

// Each: what is done to the file, and what the check says.
const std::pair<const char*, const char*> kDamages[] = {
    {"DROP TRIGGER calibration_transitions",
     "schema: trigger calibration_transitions is not there"},
    {"DROP INDEX one_active_calibration",
     "schema: index one_active_calibration is not there"},
    {"DROP TRIGGER calibrations_stay; CREATE TRIGGER calibrations_stay BEFORE "
     "DELETE ON calibrations BEGIN SELECT 1; END",
     "schema: trigger calibrations_stay is not that of this program"},
    {"CREATE TRIGGER more AFTER INSERT ON segments BEGIN "
     "DELETE FROM payloads; END",
     "schema: trigger more does not belong there"},
    {"CREATE TABLE more (x)", "schema: table more does not belong there"},
    {"CREATE VIEW more AS SELECT 1", "schema: view more does not belong there"},
    {"DELETE FROM table_entries; UPDATE tables SET capacity = -1",
     "holds more segments than its capacity"},
    {"UPDATE segments SET state = 3", "is not a scored segment of this rig"},
};

TEST_F(CopiesTest, WhatTheSchemaAndTheProgramRelyOnIsChecked) {
  Promise promise("a damaged schema or a broken rule is found");
  const std::string sound = BackUp();
  store_.reset();
  for (const auto& [damage, said] : kDamages) {
    SCOPED_TRACE(damage);
    const std::string path = folder_.File("damaged.db");
    WriteBytes(path, sound);
    ASSERT_TRUE(ExecuteInFile(path, damage).ok());
    const std::string bytes = ReadBytes(path);
    Reopen();
    const absl::Status refused = Restore(bytes, Sha256(bytes)).status();
    EXPECT_THAT(std::string(refused.message()), ::testing::HasSubstr(said));
    ++promise.trials;
    promise.lost += refused.ok();
  }
}

TEST_F(CopiesTest, ACopyByVacuumIsSound) {
  const std::string path = folder_.File("vacuumed.db");
  store_.reset();
  ASSERT_TRUE(ExecuteInFile(Path(), "VACUUM INTO '" + path + "'").ok());
  const std::string bytes = ReadBytes(path);
  Reopen();
  const auto previous = Restore(bytes, Sha256(bytes));
  EXPECT_TRUE(previous.ok()) << previous.status();
}

TEST_F(CopiesTest, SeveralActiveCalibrationsAreFound) {
  const std::string path = folder_.File("damaged.db");
  WriteBytes(path, BackUp());
  ASSERT_TRUE(ExecuteInFile(path,
                            "DROP INDEX one_active_calibration;"
                            "DROP TRIGGER calibration_transitions;"
                            "DROP TRIGGER calibrations_never_change;"
                            "UPDATE calibrations SET state = 1")
                  .ok());
  const auto damaged = OpenSqliteStore(path);
  ASSERT_TRUE(damaged.ok()) << damaged.status();
  std::vector<std::string> found;
  ASSERT_TRUE((*damaged)
                  ->maintenance()
                  ->Check([&](const StoreProblem& problem) {
                    found.push_back(problem.place + " " + problem.description);
                    return true;
                  })
                  .ok());
  EXPECT_THAT(
      found, ::testing::Contains("rig a does not have one active calibration"));
}

TEST_F(CopiesTest, RestoresInOneSecondKeepEveryDatabase) {
  const std::string bytes = BackUp();
  std::set<std::string> kept;
  for (int k = 0; k < 3; ++k) {
    const auto previous = Restore(bytes, Sha256(bytes));
    ASSERT_TRUE(previous.ok()) << previous.status();
    kept.insert(*previous);
    Reopen();
  }
  EXPECT_EQ(kept.size(), 3u);
  for (const std::string& path : kept) EXPECT_TRUE(fs::exists(path)) << path;
}

TEST_F(CopiesTest, ABackupIsOneInstantWhileOthersWrite) {
  std::atomic<bool> stop = false;
  std::atomic<int> stored = 0;
  std::thread writer([&] {
    for (int k = 100; !stop; ++k) {
      if (domain_->PutSegment("a", Segment(k)).ok()) stored = k;
    }
  });
  for (int trial = 0; trial < 5; ++trial) {
    const int before = stored;
    const std::string bytes = BackUp();
    const std::string path = folder_.File("copy.db");
    WriteBytes(path, bytes);
    const auto copy = OpenSqliteStore(path);
    EXPECT_TRUE(copy.ok()) << copy.status();
    if (!copy.ok()) break;  // the writer has to be stopped
    for (int k = 100; k <= before; ++k) {
      EXPECT_TRUE((*copy)->GetSegmentData("a", {"s", k}).ok()) << k;
    }
    EXPECT_EQ((*copy)
                  ->maintenance()
                  ->Check([](const auto&) { return true; })
                  ->problems,
              0);
    fs::remove(path);
  }
  stop = true;
  writer.join();
  EXPECT_FALSE(fs::exists(Path() + ".backup.new"));
}

TEST_F(CopiesTest, ABackupTakesThePlaceAtTheNextStart) {
  const std::string bytes = BackUp();
  ASSERT_TRUE(domain_->PutSegment("a", Segment(50)).ok());
  const auto previous = Restore(bytes, Sha256(bytes));
  ASSERT_TRUE(previous.ok()) << previous.status();
  EXPECT_EQ(*previous, Path() + ".before-restore-7");
  // Until then nothing has changed, and one is enough.
  EXPECT_TRUE(store_->GetSegment("a", {"s", 50}).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(
      store_->maintenance()->BeginRestore().status()));
  Reopen();
  ExpectFixture(store_.get());
  EXPECT_FALSE(store_->GetSegment("a", {"s", 50}).ok());
  const auto kept = OpenSqliteStore(*previous);
  ASSERT_TRUE(kept.ok()) << kept.status();
  EXPECT_TRUE((*kept)->GetSegment("a", {"s", 50}).ok());
}

TEST_F(CopiesTest, OlderBackupsAreMigrated) {
  const std::string path = folder_.File("old.db");
  ASSERT_TRUE(ExecuteInFile(path,
                            ReadBytes(std::string(SELFCAL_STORE_FIXTURES) +
                                      "/schema_v1.sql"))
                  .ok());
  const std::string bytes = ReadBytes(path);
  const auto previous = Restore(bytes, Sha256(bytes));
  ASSERT_TRUE(previous.ok()) << previous.status();
  Reopen();
  ExpectFixture(store_.get());
}

TEST_F(CopiesTest, WhatIsNoBackupIsRefusedAndChangesNothing) {
  const std::string bytes = BackUp();
  std::string damaged = bytes;
  for (std::size_t k = 5000; k < damaged.size(); k += 4096) damaged[k] ^= 0x55;
  const std::string cut = bytes.substr(0, bytes.size() / 2);
  EXPECT_TRUE(absl::IsDataLoss(Restore(bytes, Sha256(cut)).status()));
  EXPECT_FALSE(Restore(damaged, Sha256(damaged)).ok());
  EXPECT_FALSE(Restore(cut, Sha256(cut)).ok());
  EXPECT_FALSE(Restore("", Sha256("")).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(
      Restore("not a database", Sha256("not a database")).status()));
  Reopen();
  ExpectFixture(store_.get());
  for (const auto& entry : fs::directory_iterator(folder_.path())) {
    EXPECT_EQ(entry.path().string().find("restore"), std::string::npos)
        << entry.path();
  }
}

// The steps of the take-over, each as a kill would leave it.
TEST_F(CopiesTest, ATakeOverThatIsKilledGoesOnAtTheNextStart) {
  Promise promise("a restore survives a kill at any instant");
  const std::string backup = BackUp();
  ASSERT_TRUE(domain_->PutSegment("a", Segment(50)).ok());
  const std::string database = ReadBytes(Path());
  const std::string log = ReadBytes(Path() + "-wal");
  ASSERT_FALSE(log.empty());
  store_.reset();
  const std::string before = Path() + ".before-restore-7";
  for (int step = 0; step < 4; ++step) {
    SCOPED_TRACE(step);
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      fs::remove(entry);
    }
    WriteBytes((step < 1 ? Path() : before) + "-wal", log);
    WriteBytes(step < 2 ? Path() : before, database);
    WriteBytes(step < 3 ? Path() + ".restore-7" : Path(), backup);
    ++promise.trials;
    Reopen();
    ExpectFixture(store_.get());
    EXPECT_FALSE(store_->GetSegment("a", {"s", 50}).ok());
    EXPECT_FALSE(fs::exists(Path() + ".restore-7"));
    const auto kept = OpenSqliteStore(before);
    ASSERT_TRUE(kept.ok()) << kept.status();
    if (!(*kept)->GetSegment("a", {"s", 50}).ok()) ++promise.lost;
  }
}

TEST_F(CopiesTest, ARestoreThatEndsEarlyLeavesNothing) {
  const std::string bytes = BackUp();
  {
    auto restoration = store_->maintenance()->BeginRestore();
    ASSERT_TRUE(restoration.ok());
    ASSERT_TRUE((*restoration)->Append(bytes).ok());
    EXPECT_TRUE(absl::IsFailedPrecondition(
        store_->maintenance()->BeginRestore().status()));
  }
  EXPECT_FALSE(fs::exists(Path() + ".restore.new"));
  EXPECT_TRUE(Restore(bytes, Sha256(bytes)).ok());
}

}  // namespace
}  // namespace selfcal::server
