#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

TEST(Engines, PostgresIsAmongThem) {
  const std::string why_not = PostgresCluster::WhyNot();
  if (!why_not.empty()) {
    GTEST_SKIP() << why_not << ": the store is tested on SQLite alone";
  }
  EXPECT_EQ(Engines().size(), 2u);
}

}  // namespace
}  // namespace selfcal::server
