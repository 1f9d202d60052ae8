// Records that were changed behind the back of the store are not served.
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

class TamperingTest : public StoreTest {
 protected:
  void Damage(const std::string& table, const std::string& column) {
    store_.reset();
    const absl::Status damaged = GetParam().damage(folder_, table, column);
    ASSERT_TRUE(damaged.ok()) << damaged;
    Reopen();
  }

  const Rig rig_ = TestRig("a");
};
SELFCAL_STORE_TEST_SUITE(TamperingTest);

TEST_P(TamperingTest, DamagedDataIsNoticed) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  ASSERT_TRUE(domain_->PutSegment("a", Segment(0)).ok());
  Damage("payloads", "data");
  const absl::Status status = store_->GetSegmentData("a", {"s", 0}).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_NE(std::string(status.message()).find("s~0"), std::string::npos);
}

TEST_P(TamperingTest, DamagedCalibrationIsNoticed) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  Damage("calibrations", "content");
  EXPECT_TRUE(absl::IsDataLoss(store_->GetActiveCalibration("a").status()));
}

TEST_P(TamperingTest, DamagedRigIsNoticed) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  Damage("rigs", "definition");
  EXPECT_TRUE(absl::IsDataLoss(store_->GetRig("a").status()));
}

TEST_P(TamperingTest, DamagedInformationIsNoticedAndHidesNoOther) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  ASSERT_TRUE(domain_->PutSegment("a", Segment(0)).ok());
  ASSERT_TRUE(
      domain_->CommitScore("a", {"s", 0}, FakeInformation(rig_, 1.0)).ok());
  Damage("segment_information", "information");
  ASSERT_TRUE(domain_->PutSegment("a", Segment(1)).ok());
  EXPECT_TRUE(absl::IsDataLoss(store_->GetSegment("a", {"s", 0}).status()));
  const auto listed = store_->ListSegments("a", {});
  ASSERT_TRUE(listed.ok()) << listed.status();
  ASSERT_EQ(listed->items.size(), 2u);
  EXPECT_TRUE(listed->items[0].problem.empty());
  EXPECT_FALSE(listed->items[1].problem.empty());
  EXPECT_FALSE(listed->items[1].information.has_value());
}

TEST_P(TamperingTest, ADamagedPathHidesNothingElse) {
  ASSERT_TRUE(domain_->CreateRig(rig_).ok());
  ASSERT_TRUE(domain_->PutSegment("a", Segment(0)).ok());
  ASSERT_TRUE(
      domain_->CommitScore("a", {"s", 0}, FakeInformation(rig_, 1.0)).ok());
  Damage("segment_paths", "path");
  const auto listed = store_->ListSessionSegments("a", "s", {});
  ASSERT_TRUE(listed.ok()) << listed.status();
  ASSERT_EQ(listed->items.size(), 1u);
  EXPECT_TRUE(listed->items[0].path.empty());
  EXPECT_EQ(listed->items[0].scores.size(), rig_.groups.size());
}

}  // namespace
}  // namespace selfcal::server
