#include "server/store/sqlite/open_database.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "server/store/checksum.h"
#include "server/store/driver/statement.h"
#include "server/store/sqlite/database_file.h"
#include "server/store/sqlite/sqlite.h"
#include "test/server/store/sqlite/tamper.h"
#include "test/support/files.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

namespace fs = std::filesystem;

constexpr Migration kFirst{
    "0001_first.sql", "aa", "CREATE TABLE one (x INTEGER) STRICT;"};
constexpr Migration kSecond{"0002_second.sql",
                            "bb",
                            "CREATE TABLE two (y INTEGER) STRICT;"
                            "INSERT INTO one VALUES (7);"};
constexpr Migration kBroken{
    "0002_broken.sql", "cc", "INSERT INTO one VALUES (8); SELECT nonsense;"};

constexpr std::int64_t kTime = 7'000'000'000;

std::int64_t ReadNumber(SqliteConnection* db, const std::string& sql) {
  Statement statement(db, sql);
  const bool found = statement.Next();
  EXPECT_TRUE(found) << sql << ": " << statement.status();
  return found ? statement.Int(0) : -1;
}

std::string Hex(const std::string& bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string hex;
  for (const unsigned char byte : bytes) {
    hex += kDigits[byte >> 4];
    hex += kDigits[byte & 15];
  }
  return hex;
}

class OpenDatabaseTest : public ::testing::Test {
 protected:
  absl::StatusOr<std::unique_ptr<SqliteConnection>> Open(
      const std::vector<Migration>& migrations) {
    return OpenDatabase(path_, migrations, kTime);
  }

  // Opens what must be refused, and compares the files before and after.
  absl::Status OpenRefused(const std::vector<Migration>& migrations) {
    const std::string before = ReadBytes(path_);
    const absl::Status status = Open(migrations).status();
    EXPECT_FALSE(status.ok());
    EXPECT_EQ(ReadBytes(path_), before);
    EXPECT_FALSE(fs::exists(path_ + ".new"));
    return status;
  }

  TempFolder folder_;
  const std::string path_ = folder_.File("test.db");
};

TEST_F(OpenDatabaseTest, MigrationsAreThoseThatWereReleased) {
  // A released file never changes: add a migration, do not edit one.
  const auto migrations = SqliteMigrations();
  ASSERT_EQ(migrations.size(), 26u);
  EXPECT_EQ(migrations[0].name, "0001_initial.sql");
  EXPECT_EQ(migrations[0].sha256,
            "37b3afad0f3669fcf267a1a27ae9144cad3b9d67cabff4285254de32c31c35ba");
  EXPECT_EQ(Hex(Sha256(migrations[0].sql)), migrations[0].sha256);
  EXPECT_EQ(migrations[1].name, "0002_change.sql");
  EXPECT_EQ(migrations[1].sha256,
            "adf5980e317d2d27f223d86870c2c3dcb79f5bde58b267c701e853328cb4c1a3");
  EXPECT_EQ(migrations[2].name, "0003_eviction.sql");
  EXPECT_EQ(migrations[2].sha256,
            "5a82f4fc6db59545573f5f06ab80fcba269077339ca59dbd5ff8dc972cd80411");
  EXPECT_EQ(migrations[3].name, "0004_lifecycle.sql");
  EXPECT_EQ(migrations[3].sha256,
            "bcd30205089e8fe7cbd13379f5da0483249fe3da42095f67976948a2cc112e8c");
  EXPECT_EQ(migrations[4].name, "0005_temperature.sql");
  EXPECT_EQ(migrations[4].sha256,
            "84e8d6a957199f8ef8c2c2befc356df4218aff0dd02d34a09da51b10cae0c2b6");
  EXPECT_EQ(migrations[5].name, "0006_overview.sql");
  EXPECT_EQ(migrations[5].sha256,
            "3cb3665d806bd2ea106166e980914db83905fb4e8d37f528f0d14fbc07e5353c");
  EXPECT_EQ(migrations[6].name, "0007_motion.sql");
  EXPECT_EQ(migrations[6].sha256,
            "3344c641d38933c0b427f462012cc45057b996865f62c0d7f09056fb0c40f679");
  EXPECT_EQ(migrations[7].name, "0008_quarantine.sql");
  EXPECT_EQ(migrations[7].sha256,
            "b61cf9b4edd752aa17fe53a69d60cfcdf1c85957f206905384bc9add7ed9d6fe");
  EXPECT_EQ(migrations[8].name, "0009_verification.sql");
  EXPECT_EQ(migrations[8].sha256,
            "83bdf9b72ebe3006be94809d01f1702034e6b6c1b18e9788510f423356daa141");
  EXPECT_EQ(migrations[9].name, "0010_segment_ends.sql");
  EXPECT_EQ(migrations[9].sha256,
            "3df89de6874b16777da0c78e0a806a250ebb17739e27d4d58734bd5abe2d7d7d");
  EXPECT_EQ(migrations[10].name, "0011_labels.sql");
  EXPECT_EQ(migrations[10].sha256,
            "5297621fc586c3d9c906053da0604bb501290f651721e38a28f54924ae429068");
  EXPECT_EQ(migrations[11].name, "0012_steady_time.sql");
  EXPECT_EQ(migrations[11].sha256,
            "9fdec3cd2a2aa5305e13eb8fdf4c9522a3755de4a1df1bb7e5d2cf56a3e00174");
  EXPECT_EQ(migrations[12].name, "0013_replicas.sql");
  EXPECT_EQ(migrations[12].sha256,
            "4147355eec40da270f8e17b4e0a8d078020653b674c0b2793784048579288438");
  EXPECT_EQ(migrations[13].name, "0014_keys_by_rig.sql");
  EXPECT_EQ(migrations[13].sha256,
            "63865eaac3862d8157738cfab94b77972faed78ff694de5e3f797b7ed9258add");
  EXPECT_EQ(migrations[14].name, "0015_reports.sql");
  EXPECT_EQ(migrations[14].sha256,
            "e32609c5d1a8a5ca03e74c4969a0cd88267133d895f700ffce9809919ca5a3d2");
  EXPECT_EQ(migrations[15].name, "0016_fleet.sql");
  EXPECT_EQ(migrations[15].sha256,
            "6f36f91c2ed9246dff77dd3afb7219a78dc9a65fe92c385a80477608663199a6");
  EXPECT_EQ(migrations[16].name, "0017_lists_over_rigs.sql");
  EXPECT_EQ(migrations[16].sha256,
            "99a8680853b476090635f29974a1cfeb4c004b6d42a50438a903a6337f613763");
  EXPECT_EQ(migrations[17].name, "0018_cohorts.sql");
  EXPECT_EQ(migrations[17].sha256,
            "eb5e60563d326e63d218276d3a604cd7811df5e0c5dc82ca3332e8178e4f06d5");
  EXPECT_EQ(migrations[18].name, "0019_scores_by_rig.sql");
  EXPECT_EQ(migrations[18].sha256,
            "525d1c3af0167c4cd9fdae1a3e066342e41101f0843eebbd7c730b8d808cebd7");
  EXPECT_EQ(migrations[19].name, "0020_rig_checks.sql");
  EXPECT_EQ(migrations[19].sha256,
            "a3dbe08b5b5413caa17e6bba2678db9e8289d951deba6809e195388b078ff656");
  EXPECT_EQ(migrations[20].name, "0021_names_and_orders.sql");
  EXPECT_EQ(migrations[20].sha256,
            "e811005c62a89ef5d2e0d1dccb8bc8b3c8f2cdfcadbefd64797106fe23deef61");
  EXPECT_EQ(migrations[21].name, "0022_report_order.sql");
  EXPECT_EQ(migrations[21].sha256,
            "80bd4d7586b997c08340f60dab60233b65f475e329c5c6f5dc1928515ebaaf6b");
  EXPECT_EQ(migrations[22].name, "0023_ended_reports.sql");
  EXPECT_EQ(migrations[22].sha256,
            "e277f3ecb3eb56c4b305b87fe2dbc0e56350bbb9a92936c1e389e68c8b50a479");
  EXPECT_EQ(migrations[23].name, "0024_segments_over_rigs.sql");
  EXPECT_EQ(migrations[23].sha256,
            "11a8d656dbb51d9d0009ae05416dbe5c2ce639e4c531b8e933baa220026d81a8");
  EXPECT_EQ(migrations[24].name, "0025_versions_and_runs.sql");
  EXPECT_EQ(migrations[24].sha256,
            "93597e60786f2cd4f94491b3c22096ed76a7c9dddf83cd032ff8be7088e949bb");
  EXPECT_EQ(migrations[25].name, "0026_outdated_scores.sql");
  EXPECT_EQ(migrations[25].sha256,
            "273945e862692f12d50cd4c0a14b9be1e95eb7532fbc9181517259921eb4cec5");
}

TEST_F(OpenDatabaseTest, NewDatabaseIsMarkedAsOursWithItsVersion) {
  auto db = Open({kFirst, kSecond});
  ASSERT_TRUE(db.ok()) << db.status();
  EXPECT_EQ(ReadNumber(db->get(), "PRAGMA application_id"), kApplicationId);
  EXPECT_EQ(ReadNumber(db->get(), "PRAGMA user_version"), 2);
  EXPECT_EQ(ReadNumber(db->get(), "SELECT count(*) FROM schema_migrations"), 2);
  EXPECT_EQ(
      ReadNumber(db->get(), "SELECT max(apply_time_ns) FROM schema_migrations"),
      kTime);
  EXPECT_FALSE(fs::exists(path_ + ".new"));
}

TEST_F(OpenDatabaseTest, RunsWithTheSettingsThatKeepThePromises) {
  auto db = Open({kFirst});
  ASSERT_TRUE(db.ok()) << db.status();
  EXPECT_EQ(ReadNumber(db->get(), "PRAGMA synchronous"), 2);
  EXPECT_EQ(ReadNumber(db->get(), "PRAGMA foreign_keys"), 1);
  EXPECT_EQ(ReadNumber(db->get(), "PRAGMA trusted_schema"), 0);
  EXPECT_EQ(ReadNumber(db->get(), "PRAGMA recursive_triggers"), 1);
  Statement mode(db->get(), "PRAGMA journal_mode");
  ASSERT_TRUE(mode.Next());
  EXPECT_EQ(mode.Text(0), "wal");
}

TEST_F(OpenDatabaseTest, OlderDatabaseIsMigratedAfterABackup) {
  ASSERT_TRUE(Open({kFirst}).ok());
  auto db = Open({kFirst, kSecond});
  ASSERT_TRUE(db.ok()) << db.status();
  EXPECT_EQ(ReadNumber(db->get(), "PRAGMA user_version"), 2);
  EXPECT_EQ(ReadNumber(db->get(), "SELECT x FROM one"), 7);
  const std::string backup = path_ + ".backup-v1";
  ASSERT_TRUE(fs::exists(backup));
  auto old = OpenDatabase(backup, std::vector<Migration>{kFirst}, kTime);
  ASSERT_TRUE(old.ok()) << old.status();
  EXPECT_EQ(ReadNumber(old->get(), "PRAGMA user_version"), 1);
  EXPECT_EQ(ReadNumber(old->get(), "SELECT count(*) FROM one"), 0);
}

TEST_F(OpenDatabaseTest, VersionsFromBeforeStatesWereExplicitKeepTheirLife) {
  const auto all = SqliteMigrations();
  const std::vector<Migration> old(all.begin(), all.begin() + 2);
  {
    auto db = Open(old);
    ASSERT_TRUE(db.ok()) << db.status();
    const absl::Status written = (*db)->Execute(
        "INSERT INTO rigs VALUES (1, 'a', 0, x'00', x'00');"
        "INSERT INTO segments VALUES "
        "  (1, 1, 's', 0, 1, 2, '', 0, 1, 0, 1, 1, 1, 1, 1);"
        "INSERT INTO runs (rig, run, state, cause, create_time_ns, "
        "  base_version, message) VALUES (1, 1, 3, 1, 0, 1, 'm');"
        "INSERT INTO run_segments VALUES (1, 1, 1);"
        "INSERT INTO calibrations VALUES "
        "  (1, 1, 2, 3, NULL, x'01', x'02'), (1, 2, 3, 4, 1, x'03', x'04'),"
        "  (1, 3, 1, 5, 1, x'05', x'06');"
        "INSERT INTO calibration_segments VALUES (1, 3, 1);"
        "INSERT INTO changes VALUES (1, 1, 0, 1, 1, 1, 1.5);"
        "INSERT INTO change_groups VALUES (1, 1, 'imu');"
        "INSERT INTO events VALUES (7, 0, 'a', 1, 'x');");
    ASSERT_TRUE(written.ok()) << written;
  }
  auto db = Open({all.begin(), all.end()});
  ASSERT_TRUE(db.ok()) << db.status();
  EXPECT_EQ(
      ReadNumber(db->get(), "SELECT count(*) FROM pragma_foreign_key_check"),
      0);
  for (const char* sql :
       {"SELECT count(*) = 3 FROM calibrations",
        ("SELECT state = 1 AND content = x'05' FROM calibrations "
         "  WHERE version = 3"),
        // The rejected one never was active.
        "SELECT group_concat(version) = '1,3' FROM activations",
        "SELECT message = 'm' AND cause = 1 FROM runs",
        "SELECT sequence = 1 FROM run_segments",
        "SELECT version = 3 FROM calibration_segments",
        "SELECT inflation = 1.5 FROM changes",
        "SELECT group_name = 'imu' FROM change_groups",
        "SELECT event = 1 AND steady_ns = 7 FROM events"}) {
    EXPECT_EQ(ReadNumber(db->get(), sql), 1) << sql;
  }
}

// Two rigs whose segments, activations and events took turns.
constexpr char kTwoRigs[] =
    "INSERT INTO rigs (rig, id, create_time_ns, definition, sha256) VALUES "
    "  (1, 'a', 0, x'00', x'00'), (2, 'b', 0, x'00', x'00');"
    "INSERT INTO segments (segment, rig, session, session_index, sequence, "
    "  state, receive_time_ns, calibration_version, start_ns, end_ns, "
    "  keyframes, imu_samples, landmarks, observations) VALUES "
    "  (3, 1, 's', 0, 1, 2, 5, 1, 0, 1, 1, 1, 1, 1),"
    "  (4, 2, 's', 0, 1, 2, 5, 1, 0, 1, 1, 1, 1, 1),"
    "  (6, 2, 's', 1, 2, 1, 5, 1, 0, 1, 1, 1, 1, 1),"
    "  (7, 1, 's', 1, 2, 1, 5, 1, 0, 1, 1, 1, 1, 1);"
    "INSERT INTO payloads VALUES "
    "  (4, 2, x'04', 4, x'00'), (6, 2, x'06', 6, x'00'), "
    "  (7, 1, x'07', 7, x'00');"
    "INSERT INTO table_absences (segment, group_name, cause, time_ns, rival) "
    "  VALUES (4, 'imu', 3, 0, 6), (3, 'imu', 3, 0, 5);"
    "INSERT INTO calibrations (rig, version, state, create_time_ns, content, "
    "  sha256) VALUES (1, 1, 1, 0, x'00', x'00'), (2, 1, 1, 0, x'00', x'00');"
    "INSERT INTO activations (activation, rig, version, time_ns) VALUES "
    "  (2, 1, 1, 20), (3, 2, 1, 30), (5, 1, 1, 50);"
    "INSERT INTO events VALUES (2, 20, 'a', 1, 'x'), (3, 30, '', 17, 'x'), "
    "  (5, 50, 'b', 1, 'x'), (6, 10, 'a', 2, 'x');";

TEST_F(OpenDatabaseTest, NumbersOfAllRigsBecomeNumbersOfEachInTheirOrder) {
  const auto all = SqliteMigrations();
  {
    auto db = Open({all.begin(), all.begin() + 12});
    ASSERT_TRUE(db.ok()) << db.status();
    const absl::Status written = (*db)->Execute(kTwoRigs);
    ASSERT_TRUE(written.ok()) << written;
  }
  auto db = Open({all.begin(), all.end()});
  ASSERT_TRUE(db.ok()) << db.status();
  EXPECT_EQ(
      ReadNumber(db->get(), "SELECT count(*) FROM pragma_foreign_key_check"),
      0);
  for (const char* sql :
       {"SELECT group_concat(rig || ':' || sequence || ':' || hex(data)) = "
        "  '1:2:07,2:1:04,2:2:06' "
        "  FROM (SELECT * FROM payloads ORDER BY rig, sequence)",
        // The rival of the other is gone.
        "SELECT rival = 2 FROM table_absences WHERE rig = 2 AND sequence = 1",
        "SELECT rival IS NULL FROM table_absences WHERE rig = 1",
        "SELECT group_concat(rig || ':' || activation || ':' || time_ns) = "
        "  '1:1:20,1:2:50,2:1:30' FROM activations",
        "SELECT group_concat(rig || ':' || event || ':' || time_ns) = "
        "  'a:1:20,:1:30,b:1:50,a:2:10' "
        "  FROM (SELECT * FROM events ORDER BY steady_ns)"}) {
    EXPECT_EQ(ReadNumber(db->get(), sql), 1) << sql;
  }
}

// Segments with an exclusion each, of which those for rare causes are found by
// the time at which the segment arrived.
constexpr char kExclusions[] =
    "INSERT INTO rigs (rig, id, create_time_ns, definition, sha256) VALUES "
    "  (1, 'a', 0, x'00', x'00');"
    "INSERT INTO segments (rig, session, session_index, sequence, state, "
    "  receive_time_ns, calibration_version, start_ns, end_ns, keyframes, "
    "  imu_samples, landmarks, observations, steady_ns) VALUES "
    "  (1, 's', 0, 1, 2, 5, 1, 0, 1, 1, 1, 1, 1, 70),"
    "  (1, 's', 1, 2, 2, 5, 1, 0, 1, 1, 1, 1, 1, 80),"
    "  (1, 's', 2, 3, 2, 5, 1, 0, 1, 1, 1, 1, 1, 90);"
    "INSERT INTO table_absences (rig, sequence, group_name, cause, time_ns) "
    "  VALUES (1, 1, 'imu', 3, 0), (1, 2, 'imu', 4, 0), (1, 3, 'imu', 9, 0);";

TEST_F(OpenDatabaseTest, RareExclusionsKnowWhenTheirSegmentsArrived) {
  const auto all = SqliteMigrations();
  {
    auto db = Open({all.begin(), all.begin() + 23});
    ASSERT_TRUE(db.ok()) << db.status();
    const absl::Status written = (*db)->Execute(kExclusions);
    ASSERT_TRUE(written.ok()) << written;
  }
  auto db = Open({all.begin(), all.end()});
  ASSERT_TRUE(db.ok()) << db.status();
  const auto holds = [&](const std::string& expected) {
    return ReadNumber(
        db->get(),
        "SELECT group_concat(sequence || ':' || coalesce(steady_ns, '-')) = '" +
            expected +
            "' FROM (SELECT * FROM table_absences ORDER BY sequence)");
  };
  EXPECT_EQ(holds("1:-,2:80,3:90"), 1);
  EXPECT_EQ(ReadNumber(db->get(),
                       "SELECT count(*) FROM segments WHERE angular_rate IS "
                       "NOT NULL OR acceleration IS NOT NULL"),
            0);
  // Whatever becomes of them.
  ASSERT_TRUE((*db)
                  ->Execute("UPDATE table_absences SET cause = 8 "
                            "WHERE sequence = 1;"
                            "UPDATE table_absences SET cause = 2 "
                            "WHERE sequence = 2;"
                            "DELETE FROM table_absences WHERE sequence = 3;"
                            "INSERT INTO table_absences (rig, sequence, "
                            "  group_name, cause, time_ns) "
                            "VALUES (1, 3, 'imu', 5, 0);")
                  .ok());
  EXPECT_EQ(holds("1:70,2:-,3:90"), 1);
}

TEST_F(OpenDatabaseTest, FailedMigrationChangesNothing) {
  ASSERT_TRUE(Open({kFirst}).ok());
  const absl::Status status = Open({kFirst, kBroken}).status();
  EXPECT_FALSE(status.ok());
  EXPECT_NE(std::string(status.message()).find("0002_broken.sql"),
            std::string::npos);
  auto db = Open({kFirst});
  ASSERT_TRUE(db.ok()) << db.status();
  EXPECT_EQ(ReadNumber(db->get(), "SELECT count(*) FROM one"), 0);
  EXPECT_EQ(ReadNumber(db->get(), "PRAGMA user_version"), 1);
}

TEST_F(OpenDatabaseTest, NewerDatabaseIsRefusedAndUntouched) {
  ASSERT_TRUE(Open({kFirst, kSecond}).ok());
  const absl::Status status = OpenRefused({kFirst});
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_TRUE(Open({kFirst, kSecond}).ok());
}

TEST_F(OpenDatabaseTest, NewerDatabaseInItsLogIsRefusedAndUntouched) {
  ASSERT_TRUE(Open({kFirst}).ok());
  // The version is in the log alone, as after a kill.
  {
    const auto db = SqliteConnection::Open(path_, SQLITE_OPEN_READWRITE);
    ASSERT_TRUE(db.ok());
    ASSERT_TRUE((*db)->Execute("PRAGMA user_version = 9").ok());
    fs::copy(path_, path_ + ".copy");
    fs::copy(path_ + "-wal", path_ + ".copy-wal");
  }
  fs::rename(path_ + ".copy", path_);
  fs::rename(path_ + ".copy-wal", path_ + "-wal");
  const std::string log = ReadBytes(path_ + "-wal");
  EXPECT_TRUE(absl::IsFailedPrecondition(OpenRefused({kFirst})));
  EXPECT_EQ(ReadBytes(path_ + "-wal"), log);
}

TEST_F(OpenDatabaseTest, ChangedMigrationIsRefused) {
  ASSERT_TRUE(Open({kFirst}).ok());
  Migration changed = kFirst;
  changed.sha256 = "ab";
  EXPECT_TRUE(absl::IsFailedPrecondition(OpenRefused({changed})));
  EXPECT_TRUE(absl::IsFailedPrecondition(OpenRefused({changed, kSecond})));
}

TEST_F(OpenDatabaseTest, ForeignFilesAreRefusedAndUntouched) {
  for (const std::string& bytes :
       {std::string("hello, this is not a database at all"),
        std::string(5000, 'x'),
        std::string(),
        std::string("SQLite format 3\0", 16),
        std::string(200, '\0')}) {
    WriteBytes(path_, bytes);
    EXPECT_TRUE(absl::IsFailedPrecondition(OpenRefused({kFirst})));
  }
}

TEST_F(OpenDatabaseTest, DatabaseOfAnotherProgramIsRefusedAndUntouched) {
  ASSERT_TRUE(
      ExecuteInFile(path_, "PRAGMA application_id = 77; CREATE TABLE t (a)")
          .ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(OpenRefused({kFirst})));
}

TEST_F(OpenDatabaseTest, TruncatedDatabaseIsRefusedAndUntouched) {
  ASSERT_TRUE(Open({kFirst, kSecond}).ok());
  const std::string whole = ReadBytes(path_);
  for (const std::size_t size : {std::size_t{4096}, whole.size() / 2}) {
    WriteBytes(path_, whole.substr(0, size));
    EXPECT_TRUE(absl::IsDataLoss(OpenRefused({kFirst, kSecond})));
  }
}

TEST_F(OpenDatabaseTest, LogWithoutItsDatabaseIsRefused) {
  WriteBytes(path_ + "-wal", "commits of a database that was moved away");
  EXPECT_TRUE(absl::IsFailedPrecondition(Open({kFirst}).status()));
  EXPECT_FALSE(fs::exists(path_));
}

TEST_F(OpenDatabaseTest, LeftoverOfAKilledCreationIsNoObstacle) {
  WriteBytes(path_ + ".new", "half a database");
  WriteBytes(path_ + ".new-journal", "half a journal");
  EXPECT_TRUE(Open({kFirst}).ok());
}

TEST_F(OpenDatabaseTest, MissingFolderIsUnavailable) {
  EXPECT_TRUE(absl::IsUnavailable(
      OpenSqlite({.path = folder_.File("missing/selfcal.db")}).status()));
}

}  // namespace
}  // namespace selfcal::server
