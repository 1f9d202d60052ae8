// The rights of database roles in the views of the fleet (fleet_readers).
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "migrations/migrations.h"
#include "server/domain/domain.h"
#include "server/store/make_store.h"
#include "server/store/postgres/open_schema.h"
#include "server/store/postgres/postgres.h"
#include "test/server/store/postgres/postgres_test.h"
#include "test/server/test_segments.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* kViews[] = {
    "fleet_rigs", "fleet_labels", "fleet_estimates"};

class FleetReadersTest : public PostgresTest {
 protected:
  void SetUp() override {
    PostgresTest::SetUp();
    if (IsSkipped()) return;
    // Roles belong to the server, not to the database of the test before.
    for (const char* role :
         {"member", "north", "everyone", "stranger", "admin", "hub"}) {
      Do(std::string("DROP ROLE IF EXISTS ") + role);
    }
    Do("CREATE ROLE north LOGIN; CREATE ROLE everyone LOGIN;"
       "CREATE ROLE stranger LOGIN; CREATE ROLE member LOGIN IN ROLE north;"
       "CREATE ROLE hub LOGIN; CREATE ROLE admin LOGIN IN ROLE hub");
  }

  // The rigs n1 and n2 of the north, s1 of the south, and u1 without labels.
  void CreateFleet() {
    auto opened = OpenPostgres({.uri = uri_});
    ASSERT_TRUE(opened.ok()) << opened.status();
    const auto store = MakeStore(*std::move(opened));
    Domain domain(store.get());
    const auto create = [&](const std::string& id, const std::string& site) {
      StoredRig rig{TestRig(id)};
      if (!site.empty()) rig.labels = {{"model", "t4"}, {"site", site}};
      const auto created = domain.CreateRig(rig);
      ASSERT_TRUE(created.ok()) << created.status();
    };
    create("n1", "north");
    create("n2", "north");
    create("s1", "south");
    create("u1", "");
    Do("GRANT SELECT ON fleet_rigs, fleet_labels, fleet_estimates "
       "TO north, everyone, stranger");
    Do("INSERT INTO fleet_readers VALUES "
       "('north', 'site', 'north'), ('everyone', '', '')");
  }

  void Do(const std::string& sql) {
    const absl::Status status = db_->Execute(sql);
    ASSERT_TRUE(status.ok()) << sql << ": " << status;
  }
  void Become(const std::string& role) { Do("RESET ROLE; SET ROLE " + role); }

  std::vector<std::string> Texts(const std::string& sql) {
    std::vector<std::string> texts;
    Statement read(db_.get(), sql);
    while (read.Next()) texts.push_back(read.Text(0));
    EXPECT_TRUE(read.status().ok()) << sql << ": " << read.status();
    return texts;
  }
  // The rigs that the present role sees in a view.
  std::vector<std::string> Seen(const std::string& view) {
    return Texts("SELECT DISTINCT rig FROM " + view + " ORDER BY 1");
  }
  void ExpectDenied(const std::string& sql) {
    const absl::Status status = db_->Execute(sql);
    EXPECT_FALSE(status.ok()) << sql;
    EXPECT_THAT(std::string(status.message()), HasSubstr("permission denied"))
        << sql;
  }
};

TEST_F(FleetReadersTest, ARoleSeesTheRigsOfItsLabelAlone) {
  CreateFleet();
  Become("north");
  for (const char* view : kViews) {
    EXPECT_THAT(Seen(view), ElementsAre("n1", "n2")) << view;
  }
  EXPECT_EQ(Number("SELECT count(*) FROM fleet_rigs"), 2);
  EXPECT_EQ(Number("SELECT count(*) FROM fleet_labels"), 4);
}

TEST_F(FleetReadersTest, AnEmptyNameIsForAllRigs) {
  CreateFleet();
  Become("everyone");
  EXPECT_THAT(Seen("fleet_rigs"), ElementsAre("n1", "n2", "s1", "u1"));
  EXPECT_THAT(Seen("fleet_labels"), ElementsAre("n1", "n2", "s1"));
  EXPECT_THAT(Seen("fleet_estimates"), ElementsAre("n1", "n2", "s1", "u1"));
  Become("postgres");
  EXPECT_FALSE(
      db_->Execute("INSERT INTO fleet_readers VALUES ('north', '', 'x')").ok());
}

TEST_F(FleetReadersTest, ARoleWithoutARowSeesNothing) {
  CreateFleet();
  Become("stranger");
  for (const char* view : kViews) EXPECT_THAT(Seen(view), IsEmpty()) << view;
}

TEST_F(FleetReadersTest, WhoeverMayReadTheTablesSeesAllWithoutARow) {
  CreateFleet();
  Do("GRANT SELECT ON rigs TO stranger");
  for (const char* role : {"postgres", "stranger"}) {
    Become(role);
    EXPECT_THAT(Seen("fleet_rigs"), ElementsAre("n1", "n2", "s1", "u1"));
    EXPECT_THAT(Seen("fleet_labels"), ElementsAre("n1", "n2", "s1"));
    EXPECT_THAT(Seen("fleet_estimates"), ElementsAre("n1", "n2", "s1", "u1"));
  }
}

TEST_F(FleetReadersTest, TheOwnerOfTheTablesAndItsMembersSeeAll) {
  Do("GRANT CREATE ON SCHEMA public TO hub");
  Become("hub");
  ASSERT_TRUE(OpenSchema(db_.get(), PostgresMigrations(), 5).ok());
  Do("INSERT INTO rigs (rig, id, create_time_ns, definition, sha256) "
     "VALUES (1, 'n1', 0, '', '');"
     "GRANT SELECT ON fleet_rigs TO stranger");
  EXPECT_THAT(Seen("fleet_rigs"), ElementsAre("n1"));
  Become("admin");
  EXPECT_THAT(Seen("fleet_rigs"), ElementsAre("n1"));
  Become("stranger");
  EXPECT_THAT(Seen("fleet_rigs"), IsEmpty());
}

TEST_F(FleetReadersTest, SeveralRowsAddUpAndShowNoRigTwice) {
  CreateFleet();
  Do("INSERT INTO fleet_readers VALUES ('north', 'model', 't4')");
  Become("north");
  EXPECT_THAT(Texts("SELECT rig FROM fleet_rigs ORDER BY 1"),
              ElementsAre("n1", "n2", "s1"));
  Become("postgres");
  Do("INSERT INTO fleet_readers VALUES ('north', '', '')");
  Become("north");
  EXPECT_THAT(Texts("SELECT rig FROM fleet_rigs ORDER BY 1"),
              ElementsAre("n1", "n2", "s1", "u1"));
}

TEST_F(FleetReadersTest, AMemberSeesWhatItsRolesSee) {
  CreateFleet();
  Become("member");
  for (const char* view : kViews) {
    EXPECT_THAT(Seen(view), ElementsAre("n1", "n2")) << view;
  }
  Become("postgres");
  Do("INSERT INTO fleet_readers VALUES ('member', 'site', 'south')");
  Become("member");
  EXPECT_THAT(Seen("fleet_rigs"), ElementsAre("n1", "n2", "s1"));
  Become("north");
  EXPECT_THAT(Seen("fleet_rigs"), ElementsAre("n1", "n2"));
}

TEST_F(FleetReadersTest, LabelsAndRowsTakeEffectAtOnce) {
  CreateFleet();
  Do("UPDATE rig_labels SET value = 'south' "
     "WHERE rig = (SELECT rig FROM rigs WHERE id = 'n2')");
  Become("north");
  EXPECT_THAT(Seen("fleet_estimates"), ElementsAre("n1"));
  Become("postgres");
  Do("DELETE FROM fleet_readers");
  Become("north");
  EXPECT_THAT(Seen("fleet_estimates"), IsEmpty());
}

TEST_F(FleetReadersTest, AReaderCanNeitherReadTablesNorGiveItselfRights) {
  CreateFleet();
  Become("north");
  for (const char* relation : {"rigs",
                               "rig_labels",
                               "estimates",
                               "calibrations",
                               "fleet_readers",
                               "reader_labels",
                               "reader_sees_all",
                               "reader_rigs",
                               "every_rig",
                               "every_label",
                               "every_estimate"}) {
    ExpectDenied(std::string("SELECT * FROM ") + relation);
  }
  ExpectDenied("INSERT INTO fleet_readers VALUES ('north', '', '')");
  ExpectDenied("UPDATE fleet_readers SET name = '', value = ''");
  ExpectDenied("DELETE FROM fleet_readers");
}

// The name of a table is not looked up among those of the reader.
TEST_F(FleetReadersTest, ATableOfTheReaderDoesNotStandForThatOfTheHub) {
  CreateFleet();
  Become("north");
  Do("CREATE TEMP TABLE rigs (rig BIGINT);"
     "CREATE TEMP TABLE fleet_readers (role TEXT, name TEXT, value TEXT);"
     "INSERT INTO fleet_readers VALUES ('north', '', '')");
  for (const char* view : kViews) {
    EXPECT_THAT(Seen(view), ElementsAre("n1", "n2")) << view;
  }
}

// A function in the condition of a query may see no row that the query may not:
// the planner would call this one first, as it costs nothing, and for rows that
// it reads from the tables in any order.
TEST_F(FleetReadersTest, AFunctionOfTheReaderSeesNoOtherRig) {
  CreateFleet();
  Become("north");
  Do("CREATE FUNCTION pg_temp.spy(rig TEXT) RETURNS BOOLEAN "
     "LANGUAGE plpgsql COST 0.000001 AS $$ BEGIN "
     "  IF rig NOT IN ('n1', 'n2') THEN RAISE EXCEPTION 'saw %', rig; END IF;"
     "  RETURN TRUE; END $$");
  for (const char* plan : {"RESET enable_nestloop",
                           "SET enable_nestloop = off",
                           "SET enable_indexscan = off;"
                           "SET enable_bitmapscan = off"}) {
    Do(plan);
    for (const char* view : kViews) {
      EXPECT_THAT(Texts(std::string("SELECT DISTINCT rig FROM ") + view +
                        " WHERE pg_temp.spy(rig) ORDER BY 1"),
                  ElementsAre("n1", "n2"))
          << view << " " << plan;
    }
  }
}

// Databases whose dashboards read the views before there were rights: they go
// on, and so do roles that read a view of these views.
TEST_F(FleetReadersTest, ReadersFromBeforeSeeWhatTheySaw) {
  const auto all = PostgresMigrations();
  const auto rights =
      std::find_if(all.begin(), all.end(), [](const Migration& migration) {
        return migration.name == "0013_fleet_readers.sql";
      });
  ASSERT_TRUE(rights != all.end());
  ASSERT_TRUE(OpenSchema(db_.get(), {all.begin(), rights}, 5).ok());
  Do("GRANT SELECT ON fleet_rigs, fleet_labels, fleet_estimates TO everyone;"
     "CREATE VIEW north_rigs WITH (security_barrier) AS "
     "  SELECT * FROM fleet_rigs WHERE rig IN (SELECT rig FROM fleet_labels "
     "    WHERE name = 'site' AND value = 'north');"
     "GRANT SELECT ON north_rigs TO north");
  ASSERT_TRUE(OpenSchema(db_.get(), all, 5).ok());
  EXPECT_THAT(
      Texts("SELECT concat_ws('/', role, name, value) FROM fleet_readers "
            "ORDER BY 1"),
      ElementsAre("everyone//", "north//"));
  Do("INSERT INTO rigs (rig, id, create_time_ns, definition, sha256) "
     "VALUES (1, 'n1', 0, '', ''), (2, 's1', 0, '', '');"
     "INSERT INTO rig_labels VALUES (1, 'site', 'north'), (2, 'site', 's')");
  Become("everyone");
  EXPECT_THAT(Seen("fleet_rigs"), ElementsAre("n1", "s1"));
  Become("north");
  EXPECT_THAT(Seen("north_rigs"), ElementsAre("n1"));
  ExpectDenied("SELECT * FROM fleet_rigs");
}

}  // namespace
}  // namespace selfcal::server
