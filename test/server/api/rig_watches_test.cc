#include "server/api/rig_watches.h"

#include <gtest/gtest.h>

#include "server/domain/domain.h"
#include "test/server/store/sqlite/open_sqlite_store.h"
#include "test/server/test_segments.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

class RigWatchesTest : public ::testing::Test {
 protected:
  RigWatchesTest() {
    auto opened = OpenSqliteStore(folder_.File("selfcal.db"));
    EXPECT_TRUE(opened.ok()) << opened.status();
    store_ = *std::move(opened);
    domain_.emplace(store_.get());
    watches_.emplace(store_.get());
    for (const char* rig : {"a", "b"}) Create(rig);
  }

  void Create(const std::string& rig) {
    EXPECT_TRUE(domain_->CreateRig(TestRig(rig)).ok());
  }
  void Delete(const std::string& rig) {
    EXPECT_TRUE(domain_->DeleteRig(rig, "me", "sold").ok());
  }

  struct Watch {
    std::shared_ptr<WatchQueue> queue = std::make_shared<WatchQueue>();
    std::shared_ptr<void> registered;

    bool HasEnded() const {
      const WatchQueue::Taken taken = queue->Take();
      EXPECT_EQ(taken.ended, absl::IsNotFound(taken.status));
      return taken.ended;
    }
  };
  Watch Add(const std::string& rig) {
    Watch watch;
    auto added = watches_->Add(rig, watch.queue);
    EXPECT_TRUE(added.ok()) << added.status();
    watch.registered = *std::move(added);
    return watch;
  }

  TempFolder folder_;
  std::unique_ptr<Store> store_;
  std::optional<Domain> domain_;
  std::optional<RigWatches> watches_;
};

TEST_F(RigWatchesTest, ThoseOfARigThatIsGoneEnd) {
  const Watch a = Add("a");
  const Watch b = Add("b");
  watches_->DeletionHandler()("a");
  watches_->DeletionHandler()("");
  EXPECT_FALSE(a.HasEnded());
  Delete("a");
  watches_->DeletionHandler()("b");
  EXPECT_FALSE(a.HasEnded());
  watches_->DeletionHandler()("a");
  EXPECT_TRUE(a.HasEnded());
  EXPECT_FALSE(b.HasEnded());
}

TEST_F(RigWatchesTest, ThoseOfANewRigOfTheNameGoOn) {
  const Watch old_one = Add("a");
  Delete("a");
  Create("a");
  const Watch new_one = Add("a");
  const Watch b = Add("b");
  watches_->DeletionHandler()("");  // as if the announcement were lost
  EXPECT_TRUE(old_one.HasEnded());
  EXPECT_FALSE(new_one.HasEnded());
  EXPECT_FALSE(b.HasEnded());
}

TEST_F(RigWatchesTest, ManyRigsAreLookedFor) {
  std::vector<Watch> watches;
  for (int k = 0; k < 2500; ++k)
    watches.push_back(Add("r" + std::to_string(k)));
  for (int k = 0; k < 2500; k += 500) Create("r" + std::to_string(k));
  watches_->DeletionHandler()("");
  for (int k = 0; k < 2500; ++k) EXPECT_EQ(watches[k].HasEnded(), k % 500 == 0);
}

TEST_F(RigWatchesTest, OneThatIsReleasedIsForgotten) {
  Watch a = Add("a");
  const auto handler = watches_->DeletionHandler();
  a.registered.reset();
  watches_.reset();
  Delete("a");
  handler("");
  EXPECT_FALSE(a.HasEnded());
}

}  // namespace
}  // namespace selfcal::server
