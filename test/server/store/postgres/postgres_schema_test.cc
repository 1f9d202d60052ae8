// What the schema itself refuses, whoever writes, and what the check of it
// finds.
#include <string>
#include <utility>
#include <vector>

#include "server/domain/calibration_life.h"
#include "server/store/driver/sql_condition.h"
#include "server/store/make_store.h"
#include "server/store/postgres/postgres.h"
#include "server/store/segment_query_sql.h"
#include "test/server/store/fixture_content.h"
#include "test/server/store/postgres/postgres_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr CalibrationState kStates[] = {CalibrationState::kActive,
                                        CalibrationState::kSuperseded,
                                        CalibrationState::kRejected,
                                        CalibrationState::kCandidate,
                                        CalibrationState::kRolledBack};

class PostgresSchemaTest : public PostgresTest {
 protected:
  void SetUp() override {
    PostgresTest::SetUp();
    if (IsSkipped()) return;
    auto opened = OpenPostgres({.uri = uri_});
    ASSERT_TRUE(opened.ok()) << opened.status();
    const auto store = MakeStore(*std::move(opened));
    ASSERT_TRUE(WriteFixture(store.get()));
  }

  std::vector<std::string> ReadTexts(const std::string& sql) {
    std::vector<std::string> texts;
    Statement read(db_.get(), sql);
    while (read.Next()) texts.push_back(read.Text(0));
    EXPECT_TRUE(read.status().ok()) << read.status();
    return texts;
  }

  // The plan that reads the places of the first page of a rig.
  std::string PlanOfFirstPage(const SegmentQuery& query) {
    SqlCondition condition;
    Statement plan(
        db_.get(),
        "EXPLAIN " + SelectPlaces(7, query, {}, std::nullopt, 51, &condition));
    condition.Bind(&plan);
    std::string steps;
    while (plan.Next()) steps += plan.Text(0) + "\n";
    EXPECT_TRUE(plan.status().ok()) << plan.status();
    return steps;
  }

  std::vector<std::string> Problems() {
    std::vector<std::string> problems;
    db_->CheckStructure([&](const StoreProblem& problem) {
      problems.push_back(problem.place + ": " + problem.description);
      return true;
    });
    return problems;
  }
};

TEST_F(PostgresSchemaTest, RecordsThatNeverChangeCannotBeChangedOrDeleted) {
  for (const char* sql : {"UPDATE calibrations SET content = '\\x00'",
                          "UPDATE calibrations SET sha256 = '\\x00'",
                          "UPDATE calibrations SET version = 5",
                          "UPDATE calibrations SET create_time_ns = 5",
                          "UPDATE calibrations SET create_steady_ns = 5",
                          "UPDATE calibrations SET state = 3",
                          "DELETE FROM calibrations",
                          "TRUNCATE calibrations CASCADE",
                          "UPDATE calibration_segments SET sequence = 1",
                          "DELETE FROM calibration_segments",
                          "UPDATE activations SET time_ns = 0",
                          "DELETE FROM activations",
                          "UPDATE validations SET sha256 = '\\x00'",
                          "DELETE FROM validations",
                          "UPDATE events SET detail = ''",
                          "DELETE FROM events",
                          "TRUNCATE events"}) {
    const absl::Status status = db_->Execute(sql);
    EXPECT_TRUE(absl::IsInternal(status)) << sql << ": " << status;
    EXPECT_THAT(std::string(status.message()),
                ::testing::AnyOf(HasSubstr("never"), HasSubstr("does not")))
        << sql;
  }
}

TEST_F(PostgresSchemaTest, EveryTransitionThatIsNotInTheTableIsRefused) {
  const auto set = [](CalibrationState state) {
    return "UPDATE calibrations SET state = " +
           std::to_string(static_cast<int>(state)) + " WHERE version = 2";
  };
  ASSERT_TRUE(db_->Execute("DROP INDEX one_active_calibration").ok());
  int allowed = 0;
  for (const CalibrationState from : kStates) {
    for (const CalibrationState to : kStates) {
      ASSERT_TRUE(db_->Execute("SET session_replication_role = replica;" +
                               set(from) +
                               ";SET session_replication_role = origin")
                      .ok());
      EXPECT_EQ(db_->Execute(set(to)).ok(), MayBecome(from, to))
          << StateName(from) << " -> " << StateName(to);
      allowed += MayBecome(from, to) ? 1 : 0;
    }
  }
  EXPECT_EQ(allowed, 6);
}

TEST_F(PostgresSchemaTest, OnlyCandidatesAndTheFactorysBegin) {
  for (const CalibrationState state : kStates) {
    const std::string sql =
        "INSERT INTO calibrations (rig, version, state, create_time_ns, run, "
        "  content, sha256, create_steady_ns) SELECT rig, 9, " +
        std::to_string(static_cast<int>(state)) +
        ", create_time_ns, run, content, sha256, create_steady_ns "
        "FROM calibrations WHERE version = 1";
    EXPECT_EQ(db_->Execute("BEGIN;" + sql).ok(),
              state == CalibrationState::kCandidate)
        << StateName(state);
    ASSERT_TRUE(db_->Execute("ROLLBACK").ok());
  }
}

// Tables can be distributed by rig: no number is shared between rigs. What has
// no rig is exempt.
TEST_F(PostgresSchemaTest, KeysBeginWithTheRig) {
  const std::vector<std::string> others = ReadTexts(
      "SELECT format('%s by %s', x.indrelid::regclass, a.attname) "
      "FROM pg_index x JOIN pg_class t ON t.oid = x.indrelid "
      "JOIN pg_attribute a ON a.attrelid = t.oid AND a.attnum = x.indkey[0] "
      "WHERE t.relnamespace = current_schema()::regnamespace "
      "  AND x.indisunique AND a.attname <> 'rig' ORDER BY 1");
  EXPECT_THAT(others,
              ElementsAre("clock by clock",
                          "cohorts by label",
                          "ended_reports by device",
                          "fleet_readers by role",
                          "replicas by replica",
                          "rigs by id",
                          "schema_migrations by version"));
  EXPECT_THAT(ReadTexts("SELECT CAST(relname AS TEXT) FROM pg_class "
                        "WHERE relkind = 'S' "
                        "AND relnamespace = current_schema()::regnamespace"),
              IsEmpty());
}

// With few rows, the planner prefers other ways than those that many rows need.
TEST_F(PostgresSchemaTest, SegmentsOfAllRigsCanBeReadFromTheIndexOfTheirList) {
  ASSERT_TRUE(db_->Execute("SET enable_seqscan = off; SET enable_sort = off;"
                           "SET enable_bitmapscan = off")
                  .ok());
  using Order = SegmentQuery::Order;
  std::vector<std::pair<SegmentQuery, std::string>> lists(5);
  lists[0].first.order = Order::kTemperature;
  lists[0].second = "all_segments_by_temperature";
  lists[1].first.order = Order::kAngularRate;
  lists[1].second = "all_segments_by_angular_rate";
  lists[2].first.order = Order::kAcceleration;
  lists[2].first.acceleration_mps2.least = 2;
  lists[2].second = "all_segments_by_acceleration";
  lists[3].first.state = SegmentState::kUnusable;
  lists[3].second = "unusable_segments_by_time";
  lists[4].first.excluded = ExclusionCause::kDoesNotFit;
  lists[4].second = "rare_absences_by_time";
  for (const bool descending : {true, false}) {
    for (auto [query, expected] : lists) {
      query.descending = descending;
      const auto after = PlaceOfPage("list", {});
      ASSERT_TRUE(after.ok()) << after.status();
      SqlCondition condition;
      const std::string sql =
          SelectPlaces(0, query, {}, *after, 51, &condition);
      Statement plan(db_.get(), "EXPLAIN " + sql);
      condition.Bind(&plan);
      std::string steps;
      while (plan.Next()) steps += plan.Text(0) + "\n";
      EXPECT_TRUE(plan.status().ok()) << plan.status();
      EXPECT_THAT(steps, HasSubstr(expected)) << sql;
    }
  }
}

TEST_F(PostgresSchemaTest, ExclusionsOfARigForARareCauseAreReadFromTheirIndex) {
  ASSERT_TRUE(db_->Execute("SET enable_seqscan = off; SET enable_sort = off;"
                           "SET enable_bitmapscan = off")
                  .ok());
  SegmentQuery query;
  query.excluded = ExclusionCause::kDoesNotFit;
  EXPECT_THAT(PlanOfFirstPage(query), HasSubstr("rare_absences_of_rig"));
}

// The rows of a rig lie apart.
TEST_F(PostgresSchemaTest, APageOfARigIsFoundWithoutItsRows) {
  ASSERT_TRUE(db_->Execute("SET enable_seqscan = off; SET enable_sort = off;"
                           "SET enable_bitmapscan = off")
                  .ok());
  using Order = SegmentQuery::Order;
  for (const Order order : {Order::kArrival,
                            Order::kLandmarks,
                            Order::kTemperature,
                            Order::kAngularRate}) {
    SegmentQuery query;
    query.order = order;
    EXPECT_THAT(PlanOfFirstPage(query), HasSubstr("Index Only Scan Backward"));
  }
}

TEST_F(PostgresSchemaTest, ASoundSchemaHasNoProblems) {
  EXPECT_THAT(Problems(), IsEmpty());
}

TEST_F(PostgresSchemaTest, EveryDifferenceFromTheMigrationsIsFound) {
  const std::vector<std::pair<std::string, std::string>> changes = {
      {"DROP TRIGGER events_stay ON events", "trigger events_stay"},
      {"ALTER TABLE events DISABLE TRIGGER events_stay", "trigger events_stay"},
      {"DROP INDEX one_candidate", "index one_candidate"},
      {"ALTER TABLE segments DROP CONSTRAINT segments_state_check",
       "constraint segments_state_check"},
      {"ALTER TABLE runs ALTER COLUMN message DROP NOT NULL",
       "column message of table runs"},
      {"ALTER TABLE runs ALTER COLUMN attempts TYPE INTEGER",
       "column attempts of table runs"},
      {"CREATE OR REPLACE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql "
       "AS $$ BEGIN RETURN NULL; END $$",
       "function refuse"},
      {"DROP TABLE disagreements CASCADE", "table disagreements"},
      {"CREATE TABLE more (x BIGINT)", "table more"},
      {"ALTER VIEW fleet_rigs RESET (security_barrier)", "view fleet_rigs"},
  };
  for (const auto& [sql, name] : changes) {
    ASSERT_TRUE(db_->Execute("BEGIN").ok());
    ASSERT_TRUE(db_->Execute(sql).ok()) << sql;
    EXPECT_THAT(Problems(), ::testing::Contains(HasSubstr(name))) << sql;
    ASSERT_TRUE(db_->Execute("ROLLBACK").ok());
  }
}

TEST_F(PostgresSchemaTest, ReferencesThatLeadNowhereAreFound) {
  ASSERT_TRUE(db_->Execute("SET session_replication_role = replica;"
                           "DELETE FROM segments WHERE state = 1")
                  .ok());
  EXPECT_THAT(
      Problems(),
      ::testing::Contains("payloads: 1 rows refer to segments that are not "
                          "there"));
}

}  // namespace
}  // namespace selfcal::server
