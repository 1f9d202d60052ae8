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
  absl::Status Replace(const ScoreBasis& basis, double entropy) {
    return domain_->ReplaceScore("a",
                                 basis,
                                 {"s", 1},
                                 FakeInformation(rig_, entropy),
                                 FakeEnds(rig_, {"s", 1}));
  }
  // Begins the run of the two segments, whose scores at its candidate are of
  // the basis that is returned.
  ScoreBasis ScoreAtCandidate() {
    EXPECT_TRUE(domain_->BeginRun("a", 1).ok());
    EXPECT_TRUE(domain_->NoteCandidateScores("a", 1).ok());
    ScoreBasis basis = Basis(1);
    basis.run = 1;
    EXPECT_TRUE(Replace(basis, -80).ok());
    return basis;
  }
  StoredCalibration Result(CalibrationState state) const {
    StoredCalibration result;
    result.state = state;
    if (state == CalibrationState::kRejected) result.reasons = {"no use"};
    result.theta = rig_.factory;
    const int size = TangentSize(result.theta);
    result.covariance = Eigen::MatrixXd::Identity(size, size);
    return result;
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
  ASSERT_TRUE(
      domain_->FinishRun("a", 1, Result(CalibrationState::kActive)).ok());
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
  const ScoreBasis earlier = Basis(1);
  ChangePrior();
  EXPECT_TRUE(Replace(Basis(1), -60).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(Replace(earlier, -70)));
  EXPECT_EQ(Entropy(), -60);
}

// Nobody else computes them before the run ends, however long it takes.
TEST_P(OutdatedScoresTest, ScoresAtACandidateAreRecordedUntilItsRunEnds) {
  ScoreAtCandidate();
  Reopen();
  EXPECT_THAT(Outdated(), ElementsAre("a"));
  EXPECT_THAT(Outdated(kNoCheck - 1), IsEmpty());
}

TEST_P(OutdatedScoresTest, ARejectionMakesTheScoresAtTheCandidateOutdated) {
  ScoreAtCandidate();
  ASSERT_TRUE(
      domain_->FinishRun("a", 1, Result(CalibrationState::kRejected)).ok());
  EXPECT_THAT(Outdated(NowNs()), IsEmpty());
  EXPECT_THAT(Outdated(NowNs() + 61'000'000'000), ElementsAre("a"));
  EXPECT_TRUE(Replace(Basis(1), -50).ok());
  ASSERT_TRUE(domain_->EndRescoring("a", Basis(1)).ok());
  EXPECT_THAT(Outdated(), IsEmpty());
}

TEST_P(OutdatedScoresTest, ARunThatEndsWithoutAVersionLeavesOutdatedScores) {
  ScoreAtCandidate();
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kFailed, "no use").ok());
  EXPECT_THAT(Outdated(NowNs() + 61'000'000'000), ElementsAre("a"));
}

TEST_P(OutdatedScoresTest, ARunThatIsReleasedLeavesOutdatedScores) {
  const ScoreBasis at_candidate = ScoreAtCandidate();
  ASSERT_TRUE(domain_->ReleaseRun("a", 1).ok());
  EXPECT_THAT(Outdated(NowNs() + 61'000'000'000), ElementsAre("a"));
  EXPECT_TRUE(Replace(Basis(1), -50).ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(Replace(at_candidate, -90)));
  EXPECT_EQ(Entropy(), -50);
}

TEST_P(OutdatedScoresTest, ScoresAtACandidateThatBecomesActiveAreNotOutdated) {
  ScoreAtCandidate();
  ASSERT_TRUE(
      domain_->FinishRun("a", 1, Result(CalibrationState::kActive)).ok());
  ASSERT_TRUE(domain_->EndRescoring("a", Basis(1)).ok());
  EXPECT_THAT(Outdated(), ElementsAre("a"));
  ASSERT_TRUE(domain_->EndRescoring("a", Basis(2)).ok());
  EXPECT_THAT(Outdated(), IsEmpty());
}

// Scores of two versions are never mixed.
TEST_P(OutdatedScoresTest, OnlyARunReplacesScoresWhileItScoresAtItsCandidate) {
  const ScoreBasis at_candidate = ScoreAtCandidate();
  ASSERT_TRUE(domain_->NoteOutdatedScores("a").ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(Replace(Basis(1), -50)));
  ASSERT_TRUE(domain_->EndRescoring("a", Basis(1)).ok());
  EXPECT_THAT(Outdated(kNoCheck - 1), IsEmpty());
  EXPECT_THAT(Outdated(), ElementsAre("a"));
  EXPECT_EQ(Entropy(), -80);
  // Its daemon may learn later that another one has cancelled it.
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kCancelled, "on request").ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(Replace(at_candidate, -90)));
  EXPECT_EQ(Entropy(), -80);
}

TEST_P(OutdatedScoresTest, ARunThatIsNotRunningScoresAtNoCandidate) {
  EXPECT_TRUE(absl::IsFailedPrecondition(domain_->NoteCandidateScores("a", 1)));
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  ASSERT_TRUE(domain_->EndRun("a", 1, RunState::kFailed, "no use").ok());
  EXPECT_TRUE(absl::IsFailedPrecondition(domain_->NoteCandidateScores("a", 1)));
  EXPECT_THAT(Outdated(), IsEmpty());
}

}  // namespace
}  // namespace selfcal::server
