#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

TEST(Engines, PostgresIsAmongThem) {
  const std::string why_not = PostgresCluster::WhyNot();
  if (!why_not.empty()) {
    GTEST_SKIP() << why_not << ": the store is tested on SQLite alone";
  }
  std::vector<std::string> names;
  for (const Engine& engine : Engines()) names.push_back(engine.name);
  EXPECT_THAT(names, ::testing::Contains("Postgres"));
}

}  // namespace
}  // namespace selfcal::server
