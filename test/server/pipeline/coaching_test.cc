#include "server/pipeline/coaching.h"

#include <cmath>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "test/core/change/random_information.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

class Coaching : public PipelineTest {
 protected:
  // Stored and scored as the pipeline does, with this information.
  void Score(const Rig& rig,
             std::int64_t index,
             const Eigen::MatrixXd& Lambda,
             double entropy = 0) {
    const MotionSegment segment = Segment(index);
    ASSERT_TRUE(domain_->PutSegment(rig.id, segment).ok());
    SegmentInformation information = FakeInformation(rig, entropy);
    information.Lambda = Lambda;
    ASSERT_TRUE(domain_->CommitScore(rig.id, segment.key, information).ok());
  }

  static double SigmaNow(const RigCoaching& coaching, int i) {
    return coaching.coaching.advice.front().sigmas[i].sigma_now;
  }

  static Eigen::MatrixXd PriorInformation(const Rig& rig) {
    return PriorSigmas(rig).cwiseAbs2().cwiseInverse().asDiagonal();
  }
};

TEST_F(Coaching, BeginsFromTheFactorysTolerances) {
  const Rig rig = CreateRig();
  RigCoach coach(store_.get());
  const auto coaching = coach.Advise("a");
  ASSERT_TRUE(coaching.ok()) << coaching.status();
  EXPECT_EQ(coaching->calibration_version, 1);
  EXPECT_EQ(coaching->segments_since, 0);
  EXPECT_EQ(coaching->segment_s, 4);
  EXPECT_EQ(coaching->coaching.advice.size(), Primitives().size());
  const auto free = FreeComponents(rig);
  for (std::size_t i = 0; i < free.size(); ++i) {
    const double prior = PriorSigmas(rig)[free[i]];
    EXPECT_NEAR(SigmaNow(*coaching, static_cast<int>(i)), prior, 1e-9 * prior);
  }
}

TEST_F(Coaching, CountsWhatTheTablesHoldBeyondTheActiveVersion) {
  const Rig rig = CreateRig();
  RigCoach coach(store_.get());
  const double gain_before = coach.Advise("a")->coaching.advice[0].gain_nats;
  Score(rig, 0, 3 * PriorInformation(rig));
  auto coaching = coach.Advise("a");
  ASSERT_TRUE(coaching.ok()) << coaching.status();
  EXPECT_EQ(coaching->segments_since, 1);
  const double prior = PriorSigmas(rig)[FreeComponents(rig)[0]];
  EXPECT_NEAR(SigmaNow(*coaching, 0), prior / 2, 1e-9 * prior);
  EXPECT_LT(coaching->coaching.advice[0].gain_nats, gain_before);

  // Once the tables are full a run takes their segments: they are in its
  // covariance, and not counted twice.
  StartOne();
  Score(rig, 1, 3 * PriorInformation(rig), 1);
  const auto run = store_->ListUnfinishedRuns();
  ASSERT_TRUE(run.ok());
  if (run->empty()) {
    ASSERT_TRUE(pipeline_->StartRecalibration("a").ok());
  } else {
    Restart();
  }
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  coaching = pipeline_->AdviseMotion("a");
  ASSERT_TRUE(coaching.ok()) << coaching.status();
  EXPECT_EQ(coaching->calibration_version, 2);
  EXPECT_EQ(coaching->segments_since, 0);
  EXPECT_NEAR(SigmaNow(*coaching, 0), prior, 1e-9 * prior);
}

// A segment that the tables push out is of no use to the next run.
TEST_F(Coaching, ForgetsWhatTheTablesGaveUp) {
  const Rig rig = CreateRig();
  for (int i = 0; i < 4; ++i) {
    Score(rig, i, 3 * PriorInformation(rig), 10.0 - i);
  }
  RigCoach coach(store_.get());
  const auto coaching = coach.Advise("a");
  ASSERT_TRUE(coaching.ok()) << coaching.status();
  EXPECT_EQ(coaching->segments_since, rig.table_size);
}

// After a change of the device the active version, which is from before it,
// still says what the change does not concern, and nothing of the rest.
TEST_F(Coaching, DoesNotBelieveAVersionOfWhatHasChangedSince) {
  const Rig rig = CreateRig();
  RandomInformation random(5);
  Eigen::VectorXd offset = Eigen::VectorXd::Zero(TangentSize(rig.factory));
  std::int64_t index = 0;
  const auto next = [&]() -> std::optional<StoredChange> {
    const MotionSegment segment = Segment(index++);
    EXPECT_TRUE(domain_->PutSegment("a", segment).ok());
    SegmentInformation information = random.Segment(rig, rig.factory, offset);
    information.groups = ScoreGroups(rig, information.Lambda);
    const auto commit = domain_->CommitScore("a", segment.key, information);
    EXPECT_TRUE(commit.ok()) << commit.status();
    return commit->change;
  };
  next();
  next();
  StoredCalibration version;
  version.theta = rig.factory;
  version.covariance = FactoryKnownTo(rig, 0.04).covariance;
  version.report = CalibrationResult();
  version.report->status = CalibrateStatus::kConverged;
  version.report->track_noise_factor = 1;
  ASSERT_TRUE(domain_->BeginRun("a", 1).ok());
  ASSERT_TRUE(domain_->FinishRun("a", 1, version).ok());
  for (int i = 0; i < 6; ++i) EXPECT_FALSE(next());
  RigCoach coach(store_.get());
  const auto before = coach.Advise("a");
  ASSERT_TRUE(before.ok()) << before.status();

  const int turned =
      MatchComponents(TangentComponents(rig.factory), {"cam0.q_CI.x"}).at(0);
  offset(turned) = 15 * ReferenceSigmas(rig)(turned);
  std::optional<StoredChange> change;
  for (int i = 0; i < 8 && !change; ++i) change = next();
  ASSERT_TRUE(change);
  ASSERT_EQ(change->groups, std::vector<std::string>{"extrinsics"});
  const auto after = coach.Advise("a");
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_EQ(after->calibration_version, change->base_version);
  const auto free = FreeComponents(rig);
  for (std::size_t i = 0; i < free.size(); ++i) {
    const double by_version = std::sqrt(version.covariance(free[i], free[i]));
    const double now = SigmaNow(*after, static_cast<int>(i));
    if (free[i] == turned) {
      EXPECT_GT(now, 1.5 * by_version);
    } else if (free[i] < kImuTangentSize) {
      // Known still, but for the chance that these are concerned after all.
      EXPECT_LT(now, 0.5 * PriorSigmas(rig)(free[i]));
    }
  }
  EXPECT_GT(after->coaching.advice[0].gain_nats,
            before->coaching.advice[0].gain_nats);
}

TEST_F(Coaching, PredictsOnceForAVersion) {
  CreateRig("a");
  CreateRig("b");
  RigCoach coach(store_.get());
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] { EXPECT_TRUE(coach.Advise("a").ok()); });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(coach.computed(), 1);
  EXPECT_TRUE(coach.Advise("b").ok());
  EXPECT_TRUE(coach.Advise("a").ok());
  EXPECT_EQ(coach.computed(), 2);
}

// The new one has versions of the same numbers, with other values.
TEST_F(Coaching, PredictsAgainForARigThatIsCreatedAgain) {
  CreateRig("a");
  RigCoach coach(store_.get());
  EXPECT_TRUE(coach.Advise("a").ok());
  ASSERT_TRUE(domain_->DeleteRig("a", "operator", "sold").ok());
  CreateRig("a");
  EXPECT_TRUE(coach.Advise("a").ok());
  EXPECT_EQ(coach.computed(), 2);
}

// With room for the predictions of one rig, the other's are computed again, and
// are the same.
TEST_F(Coaching, KeepsNoMoreThanItMay) {
  const Rig rig = CreateRig("a");
  CreateRig("b");
  const auto size = static_cast<std::size_t>(TangentSize(rig.factory));
  RigCoach coach(store_.get(),
                 sizeof(double) * size * size * Primitives().size());
  const auto first = coach.Advise("a");
  ASSERT_TRUE(first.ok());
  EXPECT_TRUE(coach.Advise("a").ok());
  EXPECT_EQ(coach.computed(), 1);
  EXPECT_TRUE(coach.Advise("b").ok());
  const auto again = coach.Advise("a");
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(coach.computed(), 3);
  EXPECT_EQ(first->coaching.advice[0].gain_nats,
            again->coaching.advice[0].gain_nats);

  RigCoach nothing_kept(store_.get(), 0);
  EXPECT_TRUE(nothing_kept.Advise("a").ok());
}

TEST_F(Coaching, KnowsNoOtherRig) {
  RigCoach coach(store_.get());
  EXPECT_TRUE(absl::IsNotFound(coach.Advise("a").status()));
}

}  // namespace
}  // namespace selfcal::server
