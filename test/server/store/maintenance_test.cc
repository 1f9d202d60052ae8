// Check, backup and restore beside a store that is in use.
#include "server/store/maintenance.h"

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/store/checksum.h"
#include "test/server/store/fixture_content.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

class MaintenanceTest : public StoreTest {
 protected:
  MaintenanceTest() { EXPECT_TRUE(WriteFixture(store_.get())); }
};
SELFCAL_STORE_TEST_SUITE(MaintenanceTest);

TEST_P(MaintenanceTest, AHealthyDatabaseHasNoProblems) {
  const auto summary =
      store_->maintenance()->Check([](const StoreProblem& problem) {
        ADD_FAILURE() << problem.place << ": " << problem.description;
        return true;
      });
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_EQ(summary->problems, 0);
  // Two in tables, one in the reserve, one waits.
  EXPECT_EQ(summary->payloads, 4);
  // Besides, of a rig, two calibrations and three segments' information.
  EXPECT_GE(summary->checksums, 3 + 1 + 2 + 3);
  EXPECT_GT(summary->bytes, 4096);
}

TEST_P(MaintenanceTest, EveryDamagedBlobIsFound) {
  store_.reset();
  const std::vector<std::pair<std::string, std::string>> columns = {
      {"calibrations", "content"},
      {"payloads", "data"},
      {"rigs", "definition"},
      {"segment_information", "information"},
      {"segment_paths", "path"}};
  for (const auto& [table, column] : columns) {
    ASSERT_TRUE(GetParam().damage(folder_, table, column).ok()) << table;
  }
  Reopen();
  std::set<std::string> places;
  const auto summary =
      store_->maintenance()->Check([&](const StoreProblem& problem) {
        places.insert(problem.place.substr(0, problem.place.find(',')));
        return true;
      });
  ASSERT_TRUE(summary.ok()) << summary.status();
  for (const auto& [table, column] : columns) {
    EXPECT_TRUE(places.contains(table)) << table;
  }
}

TEST_P(MaintenanceTest, ABackupThatIsRestoredBringsItsRecordsBack) {
  std::string bytes;
  const auto backup =
      store_->maintenance()->Backup([&](std::string_view piece) {
        bytes += piece;
        return true;
      });
  if (absl::IsUnimplemented(backup.status()))
    GTEST_SKIP() << "by its own tools";
  ASSERT_TRUE(backup.ok()) << backup.status();
  EXPECT_EQ(backup->sha256, Sha256(bytes));
  ASSERT_TRUE(domain_->PutSegment("a", Segment(50)).ok());
  {
    const auto restoration = store_->maintenance()->BeginRestore();
    ASSERT_TRUE(restoration.ok()) << restoration.status();
    ASSERT_TRUE((*restoration)->Append(bytes).ok());
    const auto finished = (*restoration)->Finish(backup->sha256, 1);
    ASSERT_TRUE(finished.ok()) << finished.status();
  }
  Reopen();
  ExpectFixture(store_.get());
  EXPECT_TRUE(absl::IsNotFound(store_->GetSegment("a", {"s", 50}).status()));
}

}  // namespace
}  // namespace selfcal::server
