// What the schema itself refuses, whoever writes, and how it is searched.
#include <algorithm>
#include <iterator>
#include <set>
#include <sstream>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "server/domain/calibration_life.h"
#include "server/store/driver/sql_condition.h"
#include "server/store/reported_tables.h"
#include "server/store/segment_query_sql.h"
#include "test/server/store/fixture_content.h"
#include "test/server/store/sqlite/sqlite_test.h"

namespace selfcal::server {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr CalibrationState kStates[] = {CalibrationState::kActive,
                                        CalibrationState::kSuperseded,
                                        CalibrationState::kRejected,
                                        CalibrationState::kCandidate,
                                        CalibrationState::kRolledBack};

template <typename Enum>
void ExpectNumbers(const std::vector<std::pair<Enum, int>>& expected) {
  for (const auto& [enumerator, number] : expected) {
    EXPECT_EQ(static_cast<int>(enumerator), number);
  }
}

// Databases that exist hold these numbers.
TEST(NumbersOnDisk, OfStatesAndTriggersNeverChange) {
  ExpectNumbers<SegmentState>({{SegmentState::kStored, 1},
                               {SegmentState::kScored, 2},
                               {SegmentState::kUnusable, 3}});
  ExpectNumbers<CalibrationState>({{CalibrationState::kActive, 1},
                                   {CalibrationState::kSuperseded, 2},
                                   {CalibrationState::kRejected, 3},
                                   {CalibrationState::kCandidate, 4},
                                   {CalibrationState::kRolledBack, 5}});
  ExpectNumbers<RunState>({{RunState::kPending, 1},
                           {RunState::kRunning, 2},
                           {RunState::kSucceeded, 3},
                           {RunState::kFailed, 4},
                           {RunState::kCancelled, 5}});
  ExpectNumbers<RunTrigger>({{RunTrigger::kTablesFull, 1},
                             {RunTrigger::kTablesChanged, 2},
                             {RunTrigger::kManual, 3},
                             {RunTrigger::kChangeDetected, 4},
                             {RunTrigger::kCalibrationAged, 5},
                             {RunTrigger::kSessionEnded, 6}});
  ExpectNumbers<VerdictKind>({{VerdictKind::kUnknown, 0},
                              {VerdictKind::kGood, 1},
                              {VerdictKind::kWeak, 2},
                              {VerdictKind::kNotTrustworthy, 3},
                              {VerdictKind::kFactory, 4}});
  ExpectNumbers<InstructionState>({{InstructionState::kPending, 1},
                                   {InstructionState::kDone, 2},
                                   {InstructionState::kRefused, 3}});
}

TEST(NumbersOnDisk, OfKindsNeverChange) {
  ExpectNumbers<ChangeKind>(
      {{ChangeKind::kSudden, 1}, {ChangeKind::kDrift, 2}});
  ExpectNumbers<EventKind>({{EventKind::kRigCreated, 1},
                            {EventKind::kRunStarted, 2},
                            {EventKind::kRunEnded, 3},
                            {EventKind::kCalibrationPublished, 4},
                            {EventKind::kCalibrationRejected, 5},
                            {EventKind::kSegmentUnusable, 6},
                            {EventKind::kChangeDetected, 7},
                            {EventKind::kDataEvicted, 8},
                            {EventKind::kCalibrationActivated, 9},
                            {EventKind::kCalibrationRolledBack, 10},
                            {EventKind::kRunDeferred, 11},
                            {EventKind::kSegmentQuarantined, 12},
                            {EventKind::kCoresDisagree, 13},
                            {EventKind::kRigUpdated, 14},
                            {EventKind::kRigDeleted, 15},
                            {EventKind::kSegmentDeleted, 16},
                            {EventKind::kTlsFilesRefused, 17},
                            {EventKind::kClockStepped, 18}});
}

class SchemaTest : public SqliteTest {
 protected:
  void SetUp() override { ASSERT_TRUE(Open().ok()); }

  absl::Status Execute(const std::string& sql) const {
    return ExecuteInFile(Path(), sql);
  }
};

TEST_F(SchemaTest, CalibrationCannotBeChangedOrDeleted) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  store_.reset();
  for (const char* sql : {"UPDATE calibrations SET content = x'00'",
                          "UPDATE calibrations SET sha256 = x'00'",
                          "UPDATE calibrations SET version = 5",
                          "UPDATE calibrations SET create_time_ns = 5",
                          "UPDATE calibrations SET state = 3",
                          "DELETE FROM calibrations",
                          "UPDATE events SET detail = ''",
                          "DELETE FROM events"}) {
    EXPECT_FALSE(Execute(sql).ok()) << sql;
  }
}

// A new column or table is reported to a hub, or listed here with the reason
// why not.
TEST_F(SchemaTest, EveryColumnIsReportedOrKnownNotToBe) {
  std::set<std::string> expected = {
      // Of the device alone: claims, clock, reports, and what is only used to
      // compute.
      "replicas",
      "claims",
      "clock",
      "schema_migrations",
      "segment_ends",
      "uplinks",
      "outbox",
      "reported_rigs",
      "instructions",
      // Of the hub alone.
      "cohorts",
      "cohort_outliers",
      "ended_reports",
      // The hub has its own key, and derives the rest from what is reported.
      "estimates",
      "calibrations.validated",
      "calibrations.verdict",
      "calibrations.temperature_c",
      "rig_name_suffixes",
      "table_absences.steady_ns",
      "rigs.alarms",
      "rigs.session_check_ns",
      "rigs.time_check_ns",
      "rigs.score_check_ns",
      "rigs.rig",
      "rigs.id",
      "rigs.last_seen_ns",
      "rigs.earlier_events",
      "rigs.deleting"};
  std::set<std::string> reported;
  for (const ReportedTable& table : ReportedTables()) {
    const std::string name(table.name);
    if (name != "rigs") reported.insert(name + ".rig");
    if (!table.number.empty()) {
      reported.insert(name + "." + std::string(table.number));
    }
    for (const ReportedColumn& column : table.columns) {
      reported.insert(name + "." + std::string(column.name));
    }
  }
  store_.reset();
  const auto columns =
      ReadTextInFile(Path(),
                     "SELECT group_concat(t.name || '.' || c.name, ' ') "
                     "FROM sqlite_schema t JOIN pragma_table_info(t.name) c "
                     "WHERE t.type = 'table' AND t.name NOT LIKE 'sqlite%'");
  ASSERT_TRUE(columns.ok()) << columns.status();
  std::istringstream words(*columns);
  std::set<std::string> there;
  for (std::string column; words >> column;) {
    const std::string table = column.substr(0, column.find('.'));
    if (expected.contains(table) || expected.contains(column)) continue;
    there.insert(column);
  }
  std::vector<std::string> differences;
  std::set_symmetric_difference(there.begin(),
                                there.end(),
                                reported.begin(),
                                reported.end(),
                                std::back_inserter(differences));
  EXPECT_THAT(differences, ::testing::IsEmpty());
}

TEST_F(SchemaTest, CalibrationInAnotherRowIsNoticed) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  ASSERT_TRUE(domain_->CreateRig(TestRig("b")).ok());
  store_.reset();
  ASSERT_TRUE(Execute("DROP TRIGGER calibrations_never_change;"
                      "UPDATE calibrations SET "
                      "  (content, sha256) = (SELECT content, sha256 "
                      "    FROM calibrations "
                      "    WHERE rig = (SELECT rig FROM rigs WHERE id = 'a')) "
                      "WHERE rig = (SELECT rig FROM rigs WHERE id = 'b')")
                  .ok());
  ASSERT_TRUE(Open().ok());
  EXPECT_TRUE(store_->GetActiveCalibration("a").ok());
  EXPECT_TRUE(absl::IsDataLoss(store_->GetActiveCalibration("b").status()));
}

TEST_F(SchemaTest, DatabaseRefusesEveryTransitionThatIsNotInTheTable) {
  ASSERT_TRUE(WriteFixture(store_.get()));
  store_.reset();
  const auto trigger = ReadTextInFile(
      Path(),
      "SELECT sql FROM sqlite_schema WHERE name = 'calibration_transitions'");
  ASSERT_TRUE(trigger.ok()) << trigger.status();
  const auto set = [](CalibrationState state) {
    return "UPDATE calibrations SET state = " +
           std::to_string(static_cast<int>(state)) + " WHERE version = 2;";
  };
  int allowed = 0;
  for (const CalibrationState from : kStates) {
    for (const CalibrationState to : kStates) {
      ASSERT_TRUE(Execute("DROP TRIGGER calibration_transitions;" + set(from) +
                          *trigger)
                      .ok());
      EXPECT_EQ(Execute(set(to)).ok(), MayBecome(from, to))
          << StateName(from) << " -> " << StateName(to);
      allowed += MayBecome(from, to) ? 1 : 0;
    }
  }
  EXPECT_EQ(allowed, 6);
}

TEST_F(SchemaTest, DatabaseLetsOnlyCandidatesAndTheFactorysBegin) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  store_.reset();
  for (const CalibrationState state : kStates) {
    const std::string sql =
        "INSERT INTO calibrations (rig, version, state, create_time_ns, run, "
        "  content, sha256, create_steady_ns) SELECT rig, 9, " +
        std::to_string(static_cast<int>(state)) +
        ", create_time_ns, run, content, sha256, create_steady_ns "
        "FROM calibrations";
    EXPECT_EQ(Execute("BEGIN;" + sql + ";ROLLBACK").ok(),
              state == CalibrationState::kCandidate)
        << StateName(state);
  }
}

// Tables can be distributed by rig: no number is shared between rigs. What has
// no rig is exempt.
TEST_F(SchemaTest, KeysBeginWithTheRig) {
  store_.reset();
  const auto others = ReadTextInFile(
      Path(),
      "SELECT group_concat(text) FROM (SELECT t.name || ' by ' || c.name text "
      "FROM pragma_table_list t JOIN pragma_index_list(t.name) i "
      "JOIN pragma_index_info(i.name) c "
      "WHERE i.\"unique\" AND c.seqno = 0 AND c.name <> 'rig' ORDER BY text)");
  ASSERT_TRUE(others.ok()) << others.status();
  EXPECT_EQ(*others, "cohorts by label,replicas by replica,rigs by id");
  const auto rowids = ReadTextInFile(
      Path(),
      "SELECT group_concat(text) FROM (SELECT t.name || ' by ' || c.name text "
      "FROM pragma_table_list t JOIN pragma_table_info(t.name) c "
      "WHERE c.pk = 1 AND c.name <> 'rig' ORDER BY text)");
  ASSERT_TRUE(rowids.ok()) << rowids.status();
  EXPECT_EQ(*rowids,
            "clock by clock,cohorts by label,ended_reports by device,"
            "replicas by replica,schema_migrations by version");
  EXPECT_EQ(ReadIntInFile(Path(),
                          "SELECT count(*) FROM sqlite_schema "
                          "WHERE sql LIKE '%AUTOINCREMENT%'")
                .value_or(-1),
            0);
}

// Each page of a session is found by an index, and nothing is sorted.
TEST_F(SchemaTest, PagesOfASessionAreFoundInTheIndex) {
  store_.reset();
  const auto db = SqliteConnection::Open(Path(), SQLITE_OPEN_READWRITE);
  ASSERT_TRUE(db.ok());
  for (const char* sql :
       {"SELECT session_index FROM segments WHERE rig = 1 AND session = 's' "
        "AND session_index > 5 ORDER BY session_index LIMIT 10",
        "SELECT session FROM segments WHERE rig = 1 AND session > 's' "
        "ORDER BY session LIMIT 1"}) {
    Statement plan(db->get(), std::string("EXPLAIN QUERY PLAN ") + sql);
    ASSERT_TRUE(plan.Next());
    EXPECT_THAT(plan.Text(3), ::testing::HasSubstr("SEARCH segments USING"));
    EXPECT_FALSE(plan.Next()) << plan.Text(3);
  }
}

// Without statistics SQLite supposes that few rows have the same rig.
TEST_F(SchemaTest, StatementsReadTheRowsThatTheyNeed) {
  store_.reset();
  const auto db = SqliteConnection::Open(Path(), SQLITE_OPEN_READWRITE);
  ASSERT_TRUE(db.ok());
  const std::pair<const char*, std::vector<std::string>> plans[] = {
      {"SELECT s.session FROM run_segments x CROSS JOIN segments s "
       "WHERE s.rig = x.rig AND s.sequence = x.sequence AND x.rig = 1 "
       "AND x.run = 1 ORDER BY x.sequence",
       {"SEARCH x USING PRIMARY KEY (rig=? AND run=?)",
        "SEARCH s USING PRIMARY KEY (rig=? AND sequence=?)"}},
      {"SELECT count(*) FROM segments WHERE rig = 1 AND state = 1",
       {"SEARCH segments USING COVERING INDEX unscored_segments "
        "(state=? AND rig=?)"}},
      {"SELECT session FROM segments WHERE state = 1 ORDER BY rig, sequence",
       {"SEARCH segments USING INDEX unscored_segments (state=?)"}},
      {"SELECT max(gain) FROM table_entries WHERE rig = 1 AND sequence = 1",
       {"SEARCH table_entries USING COVERING INDEX entries_of_segment "
        "(rig=? AND sequence=?)"}},
      {"SELECT event FROM events WHERE (steady_ns, rig, event) > (1, 'a', 1) "
       "ORDER BY steady_ns, rig, event LIMIT 10",
       {"SEARCH events USING COVERING INDEX events_by_time "
        "((steady_ns,rig,event)>(?,?,?))"}},
      {"SELECT r.run FROM runs r JOIN rigs g USING (rig) "
       "WHERE (r.create_steady_ns, r.rig, r.run) < (1, 1, 1) "
       "ORDER BY r.create_steady_ns DESC, r.rig DESC, r.run DESC LIMIT 10",
       {"SEARCH r USING COVERING INDEX runs_by_time "
        "((create_steady_ns,rig,run)<(?,?,?))",
        "SEARCH g USING INTEGER PRIMARY KEY (rowid=?)"}},
      {"SELECT c.rig, c.version FROM calibrations c "
       "JOIN rigs g ON g.rig = c.rig WHERE c.state = 3 "
       "AND (c.create_time_ns, c.rig, c.version) < (1, 1, 1) "
       "ORDER BY c.create_time_ns DESC, c.rig DESC, c.version DESC LIMIT 10",
       {"SEARCH c USING COVERING INDEX calibrations_by_state "
        "(state=? AND (create_time_ns,rig,version)<(?,?,?))",
        "SEARCH g USING INTEGER PRIMARY KEY (rowid=?)"}},
      {"SELECT c.rig, c.version FROM calibrations c "
       "JOIN rigs g ON g.rig = c.rig "
       "WHERE c.verdict = 3 AND c.create_time_ns >= 1 "
       "ORDER BY c.create_time_ns DESC, c.rig DESC, c.version DESC LIMIT 10",
       {"SEARCH c USING COVERING INDEX calibrations_by_verdict "
        "(verdict=? AND create_time_ns>?)",
        "SEARCH g USING INTEGER PRIMARY KEY (rowid=?)"}},
      {"SELECT c.rig, c.version FROM calibrations c "
       "JOIN rigs g ON g.rig = c.rig "
       "WHERE c.temperature_c >= 10.0 AND c.temperature_c <= 20.0 "
       "AND c.temperature_c IS NOT NULL "
       "ORDER BY c.temperature_c ASC, c.rig ASC, c.version ASC LIMIT 10",
       {"SEARCH c USING COVERING INDEX calibrations_by_temperature "
        "(temperature_c>? AND temperature_c<?)",
        "SEARCH g USING INTEGER PRIMARY KEY (rowid=?)"}},
      {"SELECT r.message FROM runs r JOIN rigs g USING (rig) "
       "WHERE r.started_by = 5 "
       "ORDER BY r.create_time_ns DESC, r.rig DESC, r.run DESC LIMIT 10",
       {"SEARCH r USING INDEX runs_by_trigger (started_by=?)",
        "SEARCH g USING INTEGER PRIMARY KEY (rowid=?)"}},
      {"SELECT r.message FROM runs r JOIN rigs g USING (rig) "
       "WHERE r.duration_ns IS NOT NULL "
       "AND (r.duration_ns, r.rig, r.run) < (1, 1, 1) "
       "ORDER BY r.duration_ns DESC, r.rig DESC, r.run DESC LIMIT 10",
       {"SEARCH r USING INDEX runs_by_duration "
        "(duration_ns>? AND (duration_ns,rig,run)<(?,?,?))",
        "SEARCH g USING INTEGER PRIMARY KEY (rowid=?)"}},
      {"SELECT id FROM rigs WHERE (alarms, id) < (1, 'a') AND alarms > 0 "
       "ORDER BY alarms DESC, id DESC LIMIT 10",
       {"SEARCH rigs USING COVERING INDEX rigs_by_alarms "
        "(alarms>? AND (alarms,id)<(?,?))"}},
      {"SELECT id FROM rigs WHERE session_check_ns <= 1 "
       "ORDER BY session_check_ns LIMIT 10",
       {"SEARCH rigs USING INDEX rigs_by_session_check "
        "(session_check_ns<?)"}},
      {"SELECT id FROM rigs WHERE time_check_ns <= 1 "
       "ORDER BY time_check_ns LIMIT 10",
       {"SEARCH rigs USING INDEX rigs_by_time_check (time_check_ns<?)"}},
      {"SELECT id FROM rigs WHERE score_check_ns <= 1 "
       "ORDER BY score_check_ns LIMIT 10",
       {"SEARCH rigs USING INDEX rigs_by_score_check (score_check_ns<?)"}},
      {"SELECT e.value FROM estimates e JOIN rigs r ON r.rig = e.rig "
       "WHERE e.rig = 1 AND (e.version, e.component) > (1, 'x') "
       "ORDER BY e.rig, e.version, e.component LIMIT 10",
       {"SEARCH r USING INTEGER PRIMARY KEY (rowid=?)",
        "SEARCH e USING PRIMARY KEY (rig=? AND (version,component)>(?,?))"}},
      {"SELECT e.value FROM estimates e JOIN rigs r ON r.rig = e.rig "
       "WHERE e.component = 'x' AND (e.rig, e.version) > (1, 1) "
       "ORDER BY e.rig, e.version, e.component LIMIT 10",
       {"SEARCH e USING INDEX estimates_by_component "
        "(component=? AND (rig,version)>(?,?))",
        "SEARCH r USING INTEGER PRIMARY KEY (rowid=?)"}}};
  for (const auto& [sql, expected] : plans) {
    Statement plan(db->get(), std::string("EXPLAIN QUERY PLAN ") + sql);
    std::vector<std::string> steps;
    while (plan.Next()) steps.push_back(plan.Text(3));
    EXPECT_EQ(steps, expected) << sql;
  }
}

// The other steps of a plan read the rows of a page by their keys.
TEST_F(SchemaTest, SegmentsOfAllRigsAreReadFromTheIndexOfTheirList) {
  store_.reset();
  const auto db = SqliteConnection::Open(Path(), SQLITE_OPEN_READWRITE);
  ASSERT_TRUE(db.ok());
  using Order = SegmentQuery::Order;
  std::vector<std::pair<SegmentQuery, std::string>> lists(6);
  lists[0].first.order = Order::kTemperature;
  lists[0].second = "SEARCH s USING COVERING INDEX all_segments_by_temperature";
  lists[1].first.order = Order::kAngularRate;
  lists[1].second =
      "SEARCH s USING COVERING INDEX all_segments_by_angular_rate";
  lists[2].first.order = Order::kAcceleration;
  lists[2].first.acceleration_mps2.least = 2;
  lists[2].second =
      "SEARCH s USING COVERING INDEX all_segments_by_acceleration";
  lists[3].first.state = SegmentState::kUnusable;
  lists[3].second = "SCAN s USING INDEX unusable_segments_by_time";
  lists[4].first.state = SegmentState::kStored;
  lists[4].second = "SEARCH s USING INDEX unscored_segments";
  lists[5].first.excluded = ExclusionCause::kDoesNotFit;
  lists[5].second = "SEARCH a USING COVERING INDEX rare_absences_by_time";
  for (const bool descending : {true, false}) {
    for (auto [query, expected] : lists) {
      query.descending = descending;
      const auto after = PlaceOfPage("list", {});
      ASSERT_TRUE(after.ok()) << after.status();
      SqlCondition condition;
      const std::string sql =
          SelectPlaces(0, query, {}, *after, 51, &condition);
      Statement plan(db->get(), "EXPLAIN QUERY PLAN " + sql);
      condition.Bind(&plan);
      std::vector<std::string> steps;
      while (plan.Next()) steps.push_back(plan.Text(3));
      EXPECT_TRUE(plan.status().ok()) << plan.status();
      EXPECT_THAT(steps, Contains(HasSubstr(expected))) << sql;
      EXPECT_THAT(steps, Not(Contains(HasSubstr("FOR DISTINCT")))) << sql;
    }
  }
}

TEST_F(SchemaTest, RowsOfSeveralKeysAreSearchedNotScanned) {
  store_.reset();
  const auto db = SqliteConnection::Open(Path(), SQLITE_OPEN_READWRITE);
  ASSERT_TRUE(db.ok());
  using Rows = std::vector<std::vector<SqlCondition::Value>>;
  const std::int64_t one = 1;
  const std::int64_t two = 2;
  const std::tuple<const char*, const char*, Rows> lists[] = {
      {"SELECT s.session FROM calibration_segments c CROSS JOIN segments s "
       "WHERE s.rig = c.rig AND s.sequence = c.sequence AND ",
       "(c.rig, c.version)",
       {{one, one}, {one, two}, {two, one}}},
      {"SELECT c.state FROM calibrations c JOIN rigs g ON g.rig = c.rig WHERE ",
       "(g.id, c.version)",
       {{"a", one}, {"a", two}, {"b", one}}},
      {"SELECT rig FROM rigs WHERE ", "id", {{"a"}, {"b"}, {"c"}}},
      {"SELECT t.entropy FROM table_entries t CROSS JOIN segments s "
       "WHERE s.rig = t.rig AND s.sequence = t.sequence AND ",
       "t.rig",
       {{one}, {two}}}};
  for (const auto& [sql, columns, rows] : lists) {
    for (const std::size_t count : {std::size_t{1}, rows.size()}) {
      SqlCondition condition;
      condition.AndIn(columns, Rows(rows.begin(), rows.begin() + count));
      Statement plan(
          db->get(),
          std::string("EXPLAIN QUERY PLAN ") + sql + condition.sql());
      condition.Bind(&plan);
      int searches = 0;
      while (plan.Next()) {
        const std::string step = plan.Text(3);
        searches += step.starts_with("SEARCH");
        for (const char* table : {"c", "g", "s", "t", "rigs"}) {
          EXPECT_NE(step, std::string("SCAN ") + table) << sql << count;
        }
      }
      EXPECT_TRUE(plan.status().ok()) << plan.status();
      EXPECT_GT(searches, 0) << sql;
    }
  }
}

}  // namespace
}  // namespace selfcal::server
