// A rig records that its scores are outdated until they are computed again.
#include "server/domain/outdated_scores.h"

#include "server/domain/clock.h"
#include "test/server/store/fake_ends.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class OutdatedScoresTest : public StoreTest {
 protected:
  // Tables of two; both segments have a score at version 1.
  void SetUp() override {
    rig_ = CreateTestRig("a");
    for (int k = 0; k < 2; ++k) {
      ASSERT_TRUE(domain_->PutSegment("a", Segment(k)).ok());
      ASSERT_TRUE(domain_
                      ->CommitScore("a",
                                    {"s", k},
                                    FakeInformation(rig_, -50),
                                    FakeEnds(rig_, {"s", k}))
                      .ok());
    }
  }

  void Update(const std::function<void(StoredRig*)>& change) {
    const auto updated = domain_->UpdateRig(
        "a",
        [&](StoredRig rig) -> absl::StatusOr<StoredRig> {
          change(&rig);
          return rig;
        },
        "eve");
    ASSERT_TRUE(updated.ok()) << updated.status();
    rig_ = updated->rig.rig;
  }
  void ChangePrior() {
    Update([](StoredRig* rig) {
      rig->rig.prior_sigmas.push_back({"imu.gyro.scale.*", 0.001});
    });
  }

  // Rigs with outdated scores.
  std::vector<std::string> Outdated(std::int64_t until_ns = kNoCheck) {
    return store_->ListRigsToCheck(RigCheck::kScores, until_ns, 10).value();
  }
  ScoreBasis Basis(std::int64_t active) const {
    return {active, PriorSigmas(rig_)};
  }
  double Entropy() {
    return store_->GetSegment("a", {"s", 1})->information->groups[0].entropy;
  }

  Rig rig_;
};

SELFCAL_STORE_TEST_SUITE(OutdatedScoresTest);

TEST_P(OutdatedScoresTest, ScoresAreOutdatedAfterAnotherPriorAlone) {
  Update([](StoredRig* rig) {
    rig->labels = {{"site", "roof"}};
    rig->rig.imu_full_scale.gyro_radps = 30;
  });
  EXPECT_THAT(Outdated(), IsEmpty());
  ChangePrior();
  Reopen();
  EXPECT_THAT(Outdated(), ElementsAre("a"));
}

// The caller that made them so computes them again: nobody else does at once.
TEST_P(OutdatedScoresTest, OthersTakeOverAfterAMinute) {
  ChangePrior();
  EXPECT_THAT(Outdated(NowNs()), IsEmpty());
  EXPECT_THAT(Outdated(NowNs() + 61'000'000'000), ElementsAre("a"));
}

TEST_P(OutdatedScoresTest, ScoresAreOutdatedAfterAnActivation) {
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  StoredCalibration next;
  next.state = CalibrationState::kActive;
  next.theta = rig_.factory;
  const int size = TangentSize(next.theta);
  next.covariance = Eigen::MatrixXd::Identity(size, size);
  ASSERT_TRUE(domain_->FinishRun("a", 1, next).ok());
  EXPECT_THAT(Outdated(), IsEmpty());
  ASSERT_TRUE(domain_->ActivateCalibration("a", 1, "me", "back").ok());
  EXPECT_THAT(Outdated(), ElementsAre("a"));
  ASSERT_TRUE(domain_->EndRescoring("a", Basis(2)).ok());
  EXPECT_THAT(Outdated(), ElementsAre("a"));
  ASSERT_TRUE(domain_->EndRescoring("a", Basis(1)).ok());
  EXPECT_THAT(Outdated(), IsEmpty());
}

TEST_P(OutdatedScoresTest, ARescoringWithAnEarlierPriorEndsNothing) {
  ChangePrior();
  const ScoreBasis earlier = Basis(1);
  Update([](StoredRig* rig) { rig->rig.prior_sigmas.back().value = 0.002; });
  ASSERT_TRUE(domain_->EndRescoring("a", earlier).ok());
  EXPECT_THAT(Outdated(), ElementsAre("a"));
  ASSERT_TRUE(domain_->EndRescoring("a", Basis(1)).ok());
  EXPECT_THAT(Outdated(), IsEmpty());
}

TEST_P(OutdatedScoresTest, NoScoreWithAnEarlierPriorTakesThePlaceOfALaterOne) {
  const auto replace = [&](const ScoreBasis& basis, double entropy) {
    return domain_->ReplaceScore("a",
                                 basis,
                                 {"s", 1},
                                 FakeInformation(rig_, entropy),
                                 FakeEnds(rig_, {"s", 1}));
  };
  const ScoreBasis earlier = Basis(1);
  ChangePrior();
  EXPECT_TRUE(replace(Basis(1), -60).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(replace(earlier, -70)));
  EXPECT_EQ(Entropy(), -60);
}

}  // namespace
}  // namespace selfcal::server
