// Segments that do not fit stay out of the tables, and leave them.
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class FitRowsTest : public StoreTest {
 protected:
  FitRowsTest() {
    rig_ = TestRig("a");
    rig_.table_size = 8;
    EXPECT_TRUE(domain_->CreateRig(rig_).ok());
  }

  void ScoreWithFit(std::int64_t index,
                    double entropy,
                    double fit,
                    bool many_outliers = false) {
    Put("a", index);
    SegmentInformation information = FakeInformation(rig_, entropy);
    information.residuals.fit = fit;
    information.residuals.many_outliers = many_outliers;
    const auto commit = domain_->CommitScore("a", {"s", index}, information);
    ASSERT_TRUE(commit.ok()) << commit.status();
  }

  std::optional<Exclusion> ExclusionOf(std::int64_t index) {
    const auto exclusions = store_->ListExclusions("a", {"s", index});
    EXPECT_TRUE(exclusions.ok()) << exclusions.status();
    if (exclusions->empty()) return std::nullopt;
    EXPECT_EQ(exclusions->size(), rig_.groups.size());
    return exclusions->front();
  }

  Rig rig_;
};
SELFCAL_STORE_TEST_SUITE(FitRowsTest);

TEST_P(FitRowsTest, AVigorousSegmentThatDoesNotFitEntersNoTable) {
  for (int k = 0; k < 6; ++k) ScoreWithFit(k, 10 + k, 1.0 + 0.1 * k);
  ScoreWithFit(6, -50, 20);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 1, 2, 3, 4, 5));
  const auto exclusion = ExclusionOf(6);
  ASSERT_TRUE(exclusion.has_value());
  EXPECT_EQ(exclusion->cause, ExclusionCause::kDoesNotFit);
  EXPECT_EQ(exclusion->fit, 20);
  ASSERT_TRUE(exclusion->fit_limit.has_value());
  // Of those in the table: the median, and ten standard deviations of a median
  // distance of 0.1.
  EXPECT_NEAR(*exclusion->fit_limit, 1.2 + 10 * 0.14826, 1e-6);
  Reopen();
  EXPECT_EQ(store_->GetSegment("a", {"s", 6})->information->residuals.fit, 20);
}

TEST_P(FitRowsTest, BadSegmentsThatCameFirstLeaveForGoodOnes) {
  for (int k = 0; k < 15; ++k) ScoreWithFit(k, -100 - k, 50);
  EXPECT_EQ(TableIndices("a", 0).size(), 8u);
  for (int k = 15; k < 57; ++k) ScoreWithFit(k, 10 - 0.1 * k, 1);
  const auto kept = TableIndices("a", 0);
  ASSERT_EQ(kept.size(), 8u);
  for (const std::int64_t index : kept) EXPECT_GE(index, 15);
  const auto exclusion = ExclusionOf(14);
  ASSERT_TRUE(exclusion.has_value());
  EXPECT_EQ(exclusion->cause, ExclusionCause::kDoesNotFit);
  EXPECT_EQ(exclusion->fit, 50);
  EXPECT_FALSE(HasData("a", 14));
}

TEST_P(FitRowsTest, ABadSessionAmongGoodOnesDisplacesNone) {
  for (int k = 0; k < 8; ++k) ScoreWithFit(k, k, 1);
  for (int k = 8; k < 40; ++k) ScoreWithFit(k, -100, 30);
  EXPECT_THAT(TableIndices("a", 0), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
}

TEST_P(FitRowsTest, NoiseThatIsStatedWrongExcludesNobody) {
  for (int k = 0; k < 8; ++k) ScoreWithFit(k, 10 - k, 10 + 0.3 * k);
  EXPECT_EQ(TableIndices("a", 0).size(), 8u);
}

TEST_P(FitRowsTest, ASegmentWithManyOutliersEntersNoTable) {
  ScoreWithFit(0, -50, 0, true);
  EXPECT_THAT(TableIndices("a", 0), IsEmpty());
  const auto exclusion = ExclusionOf(0);
  ASSERT_TRUE(exclusion.has_value());
  EXPECT_EQ(exclusion->cause, ExclusionCause::kManyOutliers);
}

TEST_P(FitRowsTest, AJointSelectionKeepsWhatFitsAlone) {
  Rig rig = TestRig("joint");
  rig.selection = Selection::kJointD;
  rig.table_size = 4;
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  const auto score = [&](std::int64_t index, double fit) {
    Put("joint", index);
    SegmentInformation information =
        FakeInformation(rig, 0, 5, static_cast<unsigned>(index));
    information.Lambda =
        1e8 * Eigen::MatrixXd::Identity(information.eta.size(),
                                        information.eta.size());
    information.residuals.fit = fit;
    const auto commit =
        domain_->CommitScore("joint", {"s", index}, information);
    EXPECT_TRUE(commit.ok()) << commit.status();
  };
  score(0, 40);
  EXPECT_THAT(TableIndices("joint", 0), ElementsAre(0));
  for (int k = 1; k < 5; ++k) score(k, 1);
  for (const std::int64_t index : TableIndices("joint", 0)) {
    EXPECT_NE(index, 0);
  }
}

}  // namespace
}  // namespace selfcal::server
