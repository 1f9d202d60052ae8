#include "server/api/version_updates.h"

#include <gtest/gtest.h>

#include "selfcal/v1/calibration_service.pb.h"
#include "server/domain/domain.h"
#include "test/server/store/sqlite/open_sqlite_store.h"
#include "test/server/test_segments.h"
#include "test/support/temp_folder.h"

namespace selfcal::server {
namespace {

class VersionUpdatesTest : public ::testing::Test {
 protected:
  VersionUpdatesTest() {
    auto opened = OpenSqliteStore(folder_.File("selfcal.db"));
    EXPECT_TRUE(opened.ok()) << opened.status();
    store_ = *std::move(opened);
    Domain domain(store_.get(), {}, [] { return Moment(1'000'000'000); });
    EXPECT_TRUE(domain.CreateRig(TestRig("a")).ok());
  }

  std::shared_ptr<const StoredCalibration> Active() {
    auto active = store_->GetActiveCalibration("a");
    EXPECT_TRUE(active.ok()) << active.status();
    return std::make_shared<const StoredCalibration>(*std::move(active));
  }

  TempFolder folder_;
  std::unique_ptr<Store> store_;
};

TEST_F(VersionUpdatesTest, WatchersOfAnActivationShareItsEncoding) {
  VersionUpdates updates(store_.get());
  const auto active = Active();
  const auto one = updates.Get(active);
  ASSERT_TRUE(one.ok()) << one.status();
  EXPECT_EQ(*updates.Get(active), *one);
  EXPECT_NE(*updates.Get(Active()), *one);  // read again: may have changed
  v1::Calibration sent;
  ASSERT_TRUE(sent.ParseFromString((*one)->bytes()));
  EXPECT_EQ(sent.name(), "rigs/a/calibrations/1");
  EXPECT_EQ(sent.SerializeAsString(), (*one)->bytes());
}

// The object of a version that is forgotten may lend its address to another.
TEST_F(VersionUpdatesTest, NoVersionGetsTheEncodingOfAnother) {
  VersionUpdates updates(store_.get());
  for (std::int64_t k = 1; k <= 100; ++k) {
    auto version = std::make_shared<StoredCalibration>(*Active());
    version->version = k;
    const auto update = updates.Get(std::move(version));
    ASSERT_TRUE(update.ok()) << update.status();
    EXPECT_EQ(static_cast<const v1::Calibration&>((*update)->message()).name(),
              "rigs/a/calibrations/" + std::to_string(k));
  }
}

TEST_F(VersionUpdatesTest, AnErrorIsNotKept) {
  VersionUpdates updates(store_.get());
  auto other = std::make_shared<StoredCalibration>(*Active());
  other->rig = "b";
  EXPECT_FALSE(updates.Get(other).ok());
  Domain domain(store_.get(), {}, [] { return Moment(2'000'000'000); });
  ASSERT_TRUE(domain.CreateRig(TestRig("b")).ok());
  EXPECT_TRUE(updates.Get(other).ok());
}

}  // namespace
}  // namespace selfcal::server
