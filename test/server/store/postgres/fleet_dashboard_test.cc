// The dashboard of a fleet reads the views of the database: each of its queries
// gives rows.
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "server/store/make_store.h"
#include "server/store/postgres/postgres.h"
#include "test/server/store/fixture_content.h"
#include "test/server/store/postgres/postgres_test.h"

namespace selfcal::server {
namespace {

class FleetDashboardTest : public PostgresTest {
 protected:
  void SetUp() override {
    PostgresTest::SetUp();
    if (IsSkipped()) return;
    auto opened = OpenPostgres({.uri = uri_});
    ASSERT_TRUE(opened.ok()) << opened.status();
    const auto store = MakeStore(*std::move(opened));
    ASSERT_TRUE(WriteFixture(store.get()));
    std::ifstream file(SELFCAL_DEPLOY "/monitoring/fleet_dashboard.json");
    dashboard_ = nlohmann::json::parse(file);
  }

  // As Grafana fills in what the user has chosen.
  static std::string Filled(std::string sql, const std::string& label) {
    const std::map<std::string, std::string> variables = {
        {"${component:sqlstring}", "'cam0.focal.x'"},
        {"${label:sqlstring}", "'" + label + "'"}};
    for (const auto& [name, value] : variables) {
      for (std::size_t at = sql.find(name); at != sql.npos;
           at = sql.find(name, at + value.size())) {
        sql.replace(at, name.size(), value);
      }
    }
    return sql;
  }

  // -1 after an error.
  int Rows(const std::string& sql) {
    Statement read(db_.get(), sql);
    int rows = 0;
    while (read.Next()) ++rows;
    EXPECT_TRUE(read.status().ok()) << sql << ": " << read.status();
    return read.status().ok() ? rows : -1;
  }

  nlohmann::json dashboard_;
};

TEST_F(FleetDashboardTest, EveryQueryIsOne) {
  int queries = 0;
  for (const auto& panel : dashboard_.at("panels")) {
    for (const auto& target : panel.at("targets")) {
      const auto sql = target.at("rawSql").get<std::string>();
      EXPECT_GE(Rows(Filled(sql, "")), 0);
      EXPECT_GE(Rows(Filled(sql, "model=t4")), 0);
      ++queries;
    }
  }
  EXPECT_GE(queries, 8);
  for (const auto& variable : dashboard_.at("templating").at("list")) {
    if (variable.at("type") != "query") continue;
    EXPECT_GT(Rows(variable.at("query").get<std::string>()), 20);
  }
}

TEST_F(FleetDashboardTest, ViewsHaveWhatTheRecordsHave) {
  EXPECT_EQ(Number("SELECT count(*) FROM fleet_rigs"), 1);
  EXPECT_EQ(Number("SELECT active_version FROM fleet_rigs"), 2);
  const Calibration factory = FixtureRig().factory;
  Statement read(db_.get(),
                 "SELECT version, value, sigma, from_factory, is_active "
                 "FROM fleet_estimates WHERE component = 'cam0.focal.x' "
                 "ORDER BY version");
  ASSERT_TRUE(read.Next()) << read.status();
  EXPECT_EQ(read.Double(1), factory.cameras[0].f.x());
  EXPECT_EQ(read.Double(3), 0);
  EXPECT_EQ(read.Int(4), 0);
  ASSERT_TRUE(read.Next()) << read.status();
  EXPECT_EQ(read.Double(1), factory.cameras[0].f.x() + 1);
  EXPECT_EQ(read.Double(2), 2);
  EXPECT_NEAR(read.Double(3), 1, 1e-9);
  EXPECT_EQ(read.Int(4), 1);
  EXPECT_FALSE(read.Next());
}

}  // namespace
}  // namespace selfcal::server
