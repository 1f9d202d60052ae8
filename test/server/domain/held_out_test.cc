#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

// Tables of two; the first two segments fill them, and start run 1.
class HeldOutRowsTest : public StoreTest {
 protected:
  void SetUp() override {
    rig_ = CreateTestRig("a");
    for (int k = 0; k < 2; ++k) {
      Put("a", k);
      Score(rig_, k, -50.0);
    }
    ASSERT_TRUE(store_->GetRun("a", 1).ok());
  }

  // Segments that no table takes.
  void Outside(int first, int count) {
    for (int k = first; k < first + count; ++k) {
      Put("a", k);
      Score(rig_, k, 50.0);
    }
  }

  std::vector<std::int64_t> HeldOut(int limit) {
    const auto held_out = domain_->ListHeldOut("a", 1, limit);
    EXPECT_TRUE(held_out.ok()) << held_out.status();
    std::vector<std::int64_t> indices;
    for (const server::HeldOut& one : *held_out) {
      indices.push_back(one.key.index);
      EXPECT_EQ(one.has_data, HasData("a", one.key.index));
    }
    return indices;
  }

  Rig rig_;
};

TEST_P(HeldOutRowsTest, TheDataOfTheNewestOutsideTheTablesIsKept) {
  Outside(2, 6);
  for (int k = 0; k < 8; ++k) {
    EXPECT_EQ(HasData("a", k), k < 2 || k >= 8 - kReserve) << k;
  }
}

TEST_P(HeldOutRowsTest, ThoseWithDataComeFirstAndNoneOfTheRun) {
  Outside(2, 6);
  EXPECT_THAT(HeldOut(5), ElementsAre(7, 6, 5, 4, 3));
  // Scored segments that come into the tables after the run have data as well.
  Put("a", 8);
  Score(rig_, 8, -60.0);
  Outside(9, 4);
  EXPECT_THAT(HeldOut(6), ElementsAre(12, 11, 10, 9, 8, 7));
}

TEST_P(HeldOutRowsTest, WhatLeavesTheTablesIsOfTheReserveIfItIsNewEnough) {
  for (int k = 2; k < 4; ++k) {  // push both out
    Put("a", k);
    Score(rig_, k, -60.0 - k);
  }
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kCancelled, "").ok());
  EXPECT_TRUE(HasData("a", 0));
  EXPECT_TRUE(HasData("a", 1));
  Outside(4, kReserve);
  EXPECT_FALSE(HasData("a", 0));
  EXPECT_FALSE(HasData("a", 1));
}

TEST_P(HeldOutRowsTest, WhatIsUnusableIsNotKept) {
  Outside(2, 1);
  EXPECT_TRUE(HasData("a", 2));
  ASSERT_TRUE(domain_->MarkUnusable("a", {"s", 2}, "damaged").ok());
  EXPECT_FALSE(HasData("a", 2));
  EXPECT_THAT(HeldOut(5), ElementsAre());
}

TEST_P(HeldOutRowsTest, WhatDoesNotFitIsNotKept) {
  Outside(2, 3);
  Put("a", 5);
  SegmentInformation misfit = FakeInformation(rig_, 50.0);
  misfit.residuals.many_outliers = true;
  ASSERT_TRUE(domain_->CommitScore("a", {"s", 5}, misfit).ok());
  EXPECT_FALSE(HasData("a", 5));
  EXPECT_THAT(HeldOut(5), ElementsAre(4, 3, 2));
}

SELFCAL_STORE_TEST_SUITE(HeldOutRowsTest);

}  // namespace
}  // namespace selfcal::server
