// Creation and migration of the schema, also by several processes at once, and
// what is refused.
#include "server/store/postgres/open_schema.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <random>
#include <thread>
#include <vector>

#include "migrations/migrations.h"
#include "server/store/postgres/postgres.h"
#include "test/server/store/postgres/postgres_test.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

constexpr Migration kFirst{"0001.sql", "aa", "CREATE TABLE t (x BIGINT);"};
constexpr Migration kSecond{
    "0002.sql",
    "bb",
    "ALTER TABLE t ADD COLUMN y BIGINT; INSERT INTO t VALUES (1, 2);"};
constexpr Migration kThird{"0003.sql", "cc", "CREATE TABLE u (x BIGINT);"};
constexpr Migration kBroken{
    "0003.sql", "dd", "CREATE TABLE u (x BIGINT); SELECT 1 / 0;"};

class OpenSchemaTest : public PostgresTest {
 protected:
  absl::Status OpenWith(const std::vector<Migration>& migrations) {
    return OpenSchema(db_.get(), migrations, 5);
  }
  std::int64_t Tables() {
    return Number(
        "SELECT count(*) FROM information_schema.tables "
        "WHERE table_schema = 'public'");
  }
};

TEST_F(OpenSchemaTest, EachMigrationIsAppliedOnceAndRecorded) {
  ASSERT_TRUE(OpenWith({kFirst, kSecond}).ok());
  ASSERT_TRUE(OpenWith({kFirst, kSecond}).ok());
  ASSERT_TRUE(OpenWith({kFirst, kSecond, kThird}).ok());
  EXPECT_EQ(Number("SELECT count(*) FROM t"), 1);
  EXPECT_EQ(Number("SELECT count(*) FROM schema_migrations "
                   "WHERE apply_time_ns = 5"),
            3);
}

// Version 8 searches names by their suffixes: those of rigs from before it, of
// rigs that an earlier program adds afterwards, and not of one that it deletes.
TEST_F(OpenSchemaTest, NamesOfAllRigsHaveTheirSuffixes) {
  const auto all = PostgresMigrations();
  const std::vector<Migration> before(all.begin(), all.begin() + 7);
  ASSERT_TRUE(OpenWith(before).ok());
  const auto add = [&](const std::string& key, const std::string& name) {
    return db_->Execute(
        "INSERT INTO rigs (rig, id, create_time_ns, definition, sha256) "
        "VALUES (" +
        key + ", '" + name + "', 0, '', '')");
  };
  ASSERT_TRUE(add("7", "bolt").ok());
  ASSERT_TRUE(add("8", "oo").ok());
  ASSERT_TRUE(OpenWith({all.begin(), all.end()}).ok());
  const auto suffixes = [&](const std::string& of) {
    return Number("SELECT count(*) FROM rig_name_suffixes WHERE " + of);
  };
  EXPECT_EQ(suffixes("TRUE"), 6);
  EXPECT_EQ(suffixes("rig = 7 AND suffix IN ('bolt', 'olt', 'lt', 't')"), 4);
  EXPECT_EQ(suffixes("rig = 8 AND suffix IN ('oo', 'o')"), 2);
  ASSERT_TRUE(add("9", "nut").ok());
  EXPECT_EQ(suffixes("rig = 9 AND suffix IN ('nut', 'ut', 't')"), 3);
  ASSERT_TRUE(db_->Execute("DELETE FROM rigs WHERE rig = 7").ok());
  EXPECT_EQ(suffixes("TRUE"), 5);
}

// Version 9 knows which events are of earlier rigs: of rigs from before it, and
// of those that an earlier program adds afterwards.
TEST_F(OpenSchemaTest, RigsKnowTheEventsOfEarlierRigs) {
  const auto all = PostgresMigrations();
  const std::vector<Migration> before(all.begin(), all.begin() + 8);
  ASSERT_TRUE(OpenWith(before).ok());
  const auto add = [&](const std::string& key, const std::string& name) {
    return db_->Execute(
        "INSERT INTO rigs (rig, id, create_time_ns, definition, sha256) "
        "VALUES (" +
        key + ", '" + name + "', 0, '', '')");
  };
  const auto append = [&](const std::string& name, int number, int kind) {
    return db_->Execute("INSERT INTO events VALUES ('" + name + "', " +
                        std::to_string(number) + ", 0, 0, " +
                        std::to_string(kind) + ", '')");
  };
  constexpr int kCreated = 1;
  constexpr int kDeleted = 15;
  ASSERT_TRUE(add("7", "a").ok());
  ASSERT_TRUE(append("a", 1, kCreated).ok());
  ASSERT_TRUE(append("a", 2, kDeleted).ok());
  ASSERT_TRUE(append("a", 3, kCreated).ok());
  ASSERT_TRUE(add("8", "b").ok());
  ASSERT_TRUE(append("b", 1, kCreated).ok());
  ASSERT_TRUE(append("c", 1, kCreated).ok());
  ASSERT_TRUE(OpenWith({all.begin(), all.end()}).ok());
  ASSERT_TRUE(add("9", "c").ok());
  const auto earlier = [&](const std::string& name) {
    return Number("SELECT earlier_events FROM rigs WHERE id = '" + name + "'");
  };
  EXPECT_EQ(earlier("a"), 2);
  EXPECT_EQ(earlier("b"), 0);
  EXPECT_EQ(earlier("c"), 1);
}

// Version 11 finds exclusions for rare causes by the time at which the segment
// arrived: of those from before it, and of those that an earlier program writes
// afterwards.
TEST_F(OpenSchemaTest, RareExclusionsKnowWhenTheirSegmentsArrived) {
  const auto all = PostgresMigrations();
  const std::vector<Migration> before(all.begin(), all.begin() + 10);
  ASSERT_TRUE(OpenWith(before).ok());
  const auto write = [&](int sequence, int cause) {
    return db_->Execute(
        "INSERT INTO table_absences (rig, sequence, group_name, cause, "
        "  time_ns) VALUES (1, " +
        std::to_string(sequence) + ", 'imu', " + std::to_string(cause) +
        ", 0) ON CONFLICT (rig, sequence, group_name) DO UPDATE SET "
        "  cause = excluded.cause");
  };
  ASSERT_TRUE(db_->Execute("INSERT INTO rigs (rig, id, create_time_ns, "
                           "  definition, sha256) VALUES (1, 'a', 0, '', '')")
                  .ok());
  ASSERT_TRUE(
      db_->Execute("INSERT INTO segments (rig, session, session_index, "
                   "  sequence, state, receive_time_ns, calibration_version, "
                   "  start_ns, end_ns, keyframes, imu_samples, landmarks, "
                   "  observations, steady_ns) "
                   "SELECT 1, 's', k, k, 2, 5, 1, 0, 1, 1, 1, 1, 1, 100 + k "
                   "FROM generate_series(1, 3) k")
          .ok());
  ASSERT_TRUE(write(1, 3).ok());
  ASSERT_TRUE(write(2, 4).ok());
  ASSERT_TRUE(OpenWith({all.begin(), all.end()}).ok());
  const auto found = [&](int sequence) {
    return Number(
        "SELECT coalesce(max(steady_ns), 0) FROM table_absences "
        "WHERE sequence = " +
        std::to_string(sequence));
  };
  EXPECT_EQ(found(1), 0);
  EXPECT_EQ(found(2), 102);
  EXPECT_EQ(Number("SELECT count(*) FROM segments WHERE angular_rate IS NOT "
                   "NULL OR acceleration IS NOT NULL"),
            0);
  ASSERT_TRUE(write(1, 8).ok());
  ASSERT_TRUE(write(2, 2).ok());
  ASSERT_TRUE(write(3, 9).ok());
  EXPECT_EQ(found(1), 101);
  EXPECT_EQ(found(2), 0);
  EXPECT_EQ(found(3), 103);
}

TEST_F(OpenSchemaTest, AFailedMigrationChangesNothing) {
  ASSERT_TRUE(OpenWith({kFirst, kSecond}).ok());
  const absl::Status status = OpenWith({kFirst, kSecond, kBroken});
  EXPECT_FALSE(status.ok());
  EXPECT_THAT(std::string(status.message()), HasSubstr("0003.sql"));
  EXPECT_EQ(Tables(), 2);
  EXPECT_TRUE(OpenWith({kFirst, kSecond}).ok());
}

TEST_F(OpenSchemaTest, ANewerSchemaIsRefused) {
  ASSERT_TRUE(OpenWith({kFirst, kSecond}).ok());
  const absl::Status status = OpenWith({kFirst});
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("version 2"));
  const absl::Status other =
      OpenWith({{kFirst.name, "another", kFirst.sql}, kSecond});
  EXPECT_TRUE(absl::IsFailedPrecondition(other)) << other;
}

TEST_F(OpenSchemaTest, TheDatabaseOfAnotherProgramIsRefused) {
  for (const char* foreign :
       {"CREATE TABLE customers (id BIGINT)",
        "CREATE TABLE schema_migrations (version VARCHAR PRIMARY KEY)"}) {
    ASSERT_TRUE(db_->Execute("DROP SCHEMA public CASCADE; CREATE SCHEMA "
                             "public")
                    .ok());
    ASSERT_TRUE(db_->Execute(foreign).ok());
    const absl::Status status = OpenWith({kFirst});
    EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
    EXPECT_EQ(Tables(), 1);
  }
}

TEST_F(OpenSchemaTest, AnotherEncodingIsRefused) {
  ASSERT_TRUE(db_->Execute("CREATE DATABASE latin ENCODING 'LATIN1' "
                           "LOCALE_PROVIDER libc LOCALE 'C' TEMPLATE template0")
                  .ok());
  const auto opened = OpenPostgres({.uri = SharedPostgres().Uri("latin")});
  EXPECT_TRUE(absl::IsFailedPrecondition(opened.status())) << opened.status();
  SharedPostgres().Drop("latin");
}

// Programs that start together: each migration is applied once, and all open.
TEST_F(OpenSchemaTest, ProcessesThatStartTogetherDoNotRace) {
  std::vector<pid_t> children;
  for (int k = 0; k < 6; ++k) {
    const pid_t child = fork();
    if (child == 0) {
      const auto opened = OpenPostgres({.uri = uri_, .time_ns = 1});
      _exit(opened.ok() ? 0 : 1);
    }
    children.push_back(child);
  }
  for (const pid_t child : children) {
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_EQ(status, 0);
  }
  EXPECT_EQ(Number("SELECT count(*) FROM schema_migrations"),
            static_cast<std::int64_t>(PostgresMigrations().size()));
}

TEST_F(OpenSchemaTest, AKilledCreationLeavesNothingOrAWholeSchema) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> delay_us(0, 150'000);
  for (int trial = 0; trial < 10; ++trial) {
    ASSERT_TRUE(db_->Execute("DROP SCHEMA public CASCADE; CREATE SCHEMA "
                             "public")
                    .ok());
    const pid_t child = fork();
    if (child == 0) {
      const auto opened = OpenPostgres({.uri = uri_, .time_ns = 1});
      for (;;) pause();
    }
    std::this_thread::sleep_for(std::chrono::microseconds(delay_us(random)));
    kill(child, SIGKILL);
    ASSERT_EQ(waitpid(child, nullptr, 0), child);
    const auto opened = OpenPostgres({.uri = uri_, .time_ns = 1});
    EXPECT_TRUE(opened.ok()) << opened.status();
  }
}

}  // namespace
}  // namespace selfcal::server
