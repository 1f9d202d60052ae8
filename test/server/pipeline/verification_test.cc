// Both cores compute what is kept; errors that are planted in one of them are
// found.
#include <algorithm>
#include <cmath>
#include <mutex>

#include "core/information/segment_information.h"
#include "server/pipeline/verdict.h"
#include "server/pipeline/verification_sampler.h"
#include "server/pipeline/verifier.h"
#include "server/store/reporting_device.h"
#include "test/server/pipeline/fake_conditions.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

constexpr int kVerifiedSegments = 4;

class Checks final : public PipelineObserver {
 public:
  void OnVerdict(const std::string&, Verdict) override {}
  void OnScore(const SegmentInformation&, double) override {}
  void OnRun(const StoredRun&) override {}
  void OnCheck(CheckSubject subject, VerificationOutcome outcome) override {
    const std::lock_guard lock(mutex_);
    checks_.emplace_back(subject, outcome);
  }
  int Count(CheckSubject subject, VerificationOutcome outcome) {
    const std::lock_guard lock(mutex_);
    return static_cast<int>(
        std::ranges::count(checks_, std::pair(subject, outcome)));
  }

 private:
  std::mutex mutex_;
  std::vector<std::pair<CheckSubject, VerificationOutcome>> checks_;
};

// As by a Jacobian whose column of one component is wrong by this part.
SegmentInformation WithWrongColumn(const Rig& rig,
                                   SegmentInformation score,
                                   double part) {
  constexpr int kColumn = 2;
  score.Lambda.row(kColumn) *= 1 + part;
  score.Lambda.col(kColumn) *= 1 + part;
  score.eta(kColumn) *= 1 + part;
  score.groups = ScoreGroups(rig, score.Lambda);
  return score;
}

class VerificationTest : public PipelineTest {
 protected:
  VerificationTest() {
    estimators_ = CoreEstimators();
    options_.recheck = std::chrono::milliseconds(5);
    options_.conditions = &conditions_;
    options_.observer = &checks_;
  }
  ~VerificationTest() override { pipeline_.reset(); }

  void SubmitSegments() {
    Rig rig = TestRig("a");
    rig.table_size = kVerifiedSegments;
    ASSERT_TRUE(domain_->CreateRig(rig).ok());
    StartOne();
    for (const MotionSegment& segment : TestSegments(rig, kVerifiedSegments)) {
      const auto result = pipeline_->Submit("a", segment, nullptr);
      ASSERT_TRUE(result.ok()) << result.status();
    }
    ASSERT_TRUE(AllScored());
  }

  // The tables are full: version 2 becomes active.
  void Calibrate() {
    SubmitSegments();
    ASSERT_TRUE(RunIs(RunState::kSucceeded));
    ASSERT_EQ(store_->GetActiveCalibration("a")->version, 2);
  }

  absl::StatusOr<Verification> Verify() {
    return pipeline_->VerifyRig(
        "a", [](const VerificationStep&) {}, nullptr);
  }

  std::vector<std::string> Disagreements() {
    std::vector<std::string> details;
    const auto events = store_->ListEvents({1000, ""}, "a");
    EXPECT_TRUE(events.ok()) << events.status();
    for (const StoredEvent& event : events->items) {
      if (event.kind == EventKind::kCoresDisagree) {
        details.push_back(event.detail);
      }
    }
    return details;
  }
  std::string DisagreementOf(std::int64_t version) {
    const auto calibration = store_->GetCalibration("a", version);
    EXPECT_TRUE(calibration.ok()) << calibration.status();
    return calibration.ok() ? calibration->finding : "";
  }

  using Subject = PipelineObserver::CheckSubject;
  FakeConditions conditions_;
  Checks checks_;
};

TEST_F(VerificationTest, BothCoresAgreeOnWhatIsKept) {
  Calibrate();
  std::vector<std::string> subjects;
  int checked = 0;
  const auto verification = pipeline_->VerifyRig(
      "a",
      [&](const VerificationStep& step) {
        EXPECT_EQ(step.total, kVerifiedSegments + 1);
        if (step.score == nullptr && step.calibration == nullptr) {
          subjects.push_back(step.subject);
        } else {
          EXPECT_EQ(step.done, ++checked);
        }
      },
      nullptr);
  ASSERT_TRUE(verification.ok()) << verification.status();
  EXPECT_EQ(verification->version, 2);
  EXPECT_EQ(verification->scores.size(),
            static_cast<std::size_t>(kVerifiedSegments));
  for (const ScoreCheck& check : verification->scores) {
    EXPECT_EQ(check.outcome, VerificationOutcome::kAgrees) << check.message;
  }
  ASSERT_TRUE(verification->calibration.has_value());
  EXPECT_EQ(verification->calibration->outcome, VerificationOutcome::kAgrees)
      << verification->calibration->message;
  EXPECT_EQ(verification->calibration->segments, kVerifiedSegments);
  EXPECT_EQ(verification->calibration->segments_gone, 0);
  EXPECT_EQ(DisagreementText(*verification), "");
  EXPECT_EQ(checked, kVerifiedSegments + 1);
  ASSERT_EQ(subjects.size(), static_cast<std::size_t>(kVerifiedSegments + 1));
  EXPECT_EQ(subjects.front(), "segment s~0");
  EXPECT_EQ(subjects.back(), "calibration 2");
  EXPECT_TRUE(Disagreements().empty());
  EXPECT_EQ(DisagreementOf(2), "");
  EXPECT_EQ(checks_.Count(Subject::kScore, VerificationOutcome::kAgrees),
            kVerifiedSegments);
  EXPECT_EQ(checks_.Count(Subject::kCalibration, VerificationOutcome::kAgrees),
            1);
}

TEST_F(VerificationTest, FindsAWrongJacobianOfEitherScorer) {
  std::atomic<bool> wrong[2] = {false, false};
  const auto score_by = estimators_.score_by;
  estimators_.score_by =
      [&, score_by](
          ScorerKind scorer,
          const Rig& rig,
          const Calibration& theta0,
          const MotionSegment& segment,
          const auto& interrupted) -> absl::StatusOr<SegmentInformation> {
    auto score = score_by(scorer, rig, theta0, segment, interrupted);
    // One segment of four.
    if (!wrong[static_cast<int>(scorer)] || segment.key.index != 1) {
      return score;
    }
    return WithWrongColumn(rig, *score, 1e-3);
  };
  Calibrate();
  for (const ScorerKind scorer :
       {ScorerKind::kStructured, ScorerKind::kCeres}) {
    wrong[static_cast<int>(scorer)] = true;
    const auto verification = Verify();
    wrong[static_cast<int>(scorer)] = false;
    ASSERT_TRUE(verification.ok()) << verification.status();
    for (const ScoreCheck& check : verification->scores) {
      EXPECT_EQ(check.outcome,
                check.segment.index == 1 ? VerificationOutcome::kDiffers
                                         : VerificationOutcome::kAgrees);
    }
    EXPECT_THAT(DisagreementText(*verification),
                HasSubstr("the score of 1 of 4 segments, most on that of s~1"));
  }
  EXPECT_EQ(Disagreements().size(), 2u);
  EXPECT_THAT(DisagreementOf(2), HasSubstr("s~1"));
  EXPECT_EQ(DisagreementOf(1), "");
}

TEST_F(VerificationTest, FindsASolverThatStopsElsewhere) {
  std::atomic<bool> wrong = false;
  const auto calibrate = estimators_.calibrate;
  estimators_.calibrate = [&, calibrate](const Rig& rig,
                                         const Calibration& start,
                                         const auto& segments,
                                         const CalibrateOptions& options,
                                         const auto&... callbacks) {
    auto result = calibrate(rig, start, segments, options, callbacks...);
    if (wrong && options.solver == SolverKind::kStructured) {
      // The first component of the gyroscope's scale.
      result->theta.imu.s_g.x() += 0.3 * std::sqrt(result->covariance(0, 0));
    }
    return result;
  };
  Calibrate();
  std::vector<VerdictKind> told;
  const auto watch = pipeline_->WatchCalibration(
      "a",
      [&told](const auto& active) { told.push_back(VerdictOf(*active).kind); });
  ASSERT_TRUE(watch.ok()) << watch.status();
  wrong = true;
  const auto verification = Verify();
  ASSERT_TRUE(verification.ok()) << verification.status();
  // Those who watch the version know when the verification has ended.
  ASSERT_EQ(told.size(), 2u);
  EXPECT_NE(told[0], VerdictKind::kNotTrustworthy);
  EXPECT_EQ(told[1], VerdictKind::kNotTrustworthy);
  ASSERT_TRUE(verification->calibration.has_value());
  EXPECT_EQ(verification->calibration->outcome, VerificationOutcome::kDiffers);
  ASSERT_EQ(Disagreements().size(), 1u);
  EXPECT_THAT(Disagreements()[0],
              HasSubstr("version 2: The two cores disagree on this "
                        "calibration: imu.gyro.scale.x by 0."));
  EXPECT_NEAR(verification->calibration->difference.theta_sigmas, 0.3, 0.05);
  EXPECT_THAT(DisagreementOf(2), HasSubstr("imu.gyro.scale.x"));
  // What was found stays.
  wrong = false;
  ASSERT_TRUE(Verify().ok());
  EXPECT_THAT(DisagreementOf(2), HasSubstr("imu.gyro.scale.x"));
  EXPECT_EQ(told.size(), 2u);
}

TEST_F(VerificationTest, WhatCannotBeComputedIsNotComparedAndNoFinding) {
  Calibrate();
  estimators_.score_by = [](auto&&...) -> absl::StatusOr<SegmentInformation> {
    return absl::InternalError("out of memory");
  };
  StartOne();
  const auto verification = Verify();
  ASSERT_TRUE(verification.ok()) << verification.status();
  for (const ScoreCheck& check : verification->scores) {
    EXPECT_EQ(check.outcome, VerificationOutcome::kNotCompared);
    EXPECT_EQ(check.message, "out of memory");
  }
  EXPECT_EQ(DisagreementText(*verification), "");
  EXPECT_TRUE(Disagreements().empty());
}

TEST_F(VerificationTest, OneAtATimeAndItEndsWhenItIsInterrupted) {
  std::atomic<bool> begun = false;
  estimators_.score_by =
      [&](ScorerKind, const Rig&, const auto&, const auto&, const auto& stop)
      -> absl::StatusOr<SegmentInformation> {
    begun = true;
    if (!Eventually(stop)) return absl::InternalError("never interrupted");
    return absl::CancelledError("interrupted");
  };
  SubmitSegments();
  std::atomic<bool> interrupted = false;
  absl::Status first;
  std::thread thread([&] {
    first = pipeline_
                ->VerifyRig(
                    "a",
                    [](const VerificationStep&) {},
                    [&] { return interrupted.load(); })
                .status();
  });
  EXPECT_TRUE(Eventually([&] { return begun.load(); }));
  EXPECT_TRUE(absl::IsFailedPrecondition(Verify().status()));
  interrupted = true;
  thread.join();
  EXPECT_TRUE(absl::IsCancelled(first)) << first;
  // A stop interrupts as well.
  begun = false;
  std::thread second([&] { first = Verify().status(); });
  EXPECT_TRUE(Eventually([&] { return begun.load(); }));
  pipeline_->Stop();
  second.join();
  EXPECT_TRUE(absl::IsCancelled(first)) << first;
}

TEST_F(VerificationTest, RigOfADeviceIsVerifiedThere) {
  SubmitSegments();
  const absl::Status reported = store_->Transact("a", 1, [](UnitOfWork* tx) {
    return WriteReportingDevice(tx,
                                {.key = 1,
                                 .report = 1,
                                 .time_ns = 1,
                                 .waiting = 0,
                                 .program_version = ""});
  });
  ASSERT_TRUE(reported.ok()) << reported;
  const auto verification = Verify();
  EXPECT_TRUE(absl::IsFailedPrecondition(verification.status()));
  EXPECT_THAT(std::string(verification.status().message()),
              HasSubstr("do this on the device"));
}

TEST_F(VerificationTest, AShareIsVerifiedWhileTheDeviceIsIdle) {
  const auto score = estimators_.score;
  // What the daemon computes is wrong for one segment; checks are not.
  estimators_.score = [score](const Rig& rig,
                              const Calibration& theta0,
                              const MotionSegment& segment) {
    SegmentInformation information = score(rig, theta0, segment);
    return segment.key.index == 1 ? WithWrongColumn(rig, information, 1e-3)
                                  : information;
  };
  options_.verify_share = 1;
  conditions_.Set("busy");
  SubmitSegments();
  EXPECT_EQ(checks_.Count(Subject::kScore, VerificationOutcome::kDiffers), 0);
  EXPECT_EQ(checks_.Count(Subject::kScore, VerificationOutcome::kAgrees), 0);
  conditions_.Set("");
  EXPECT_TRUE(Eventually([&] {
    return checks_.Count(Subject::kScore, VerificationOutcome::kAgrees) +
               checks_.Count(Subject::kScore, VerificationOutcome::kDiffers) ==
           kVerifiedSegments;
  }));
  EXPECT_EQ(checks_.Count(Subject::kScore, VerificationOutcome::kDiffers), 1);
  EXPECT_TRUE(Eventually([&] { return Disagreements().size() == 1; }));
  EXPECT_THAT(Disagreements()[0], HasSubstr("s~1"));
}

TEST_F(VerificationTest, ARunIsVerifiedToo) {
  SubmitSegments();
  ASSERT_TRUE(RunIs(RunState::kSucceeded));
  // The segments are scored: what comes now is a run.
  options_.verify_share = 1;
  StartOne();
  const auto run = pipeline_->StartRecalibration("a", true);
  ASSERT_TRUE(run.ok()) << run.status();
  ASSERT_TRUE(RunIs(RunState::kSucceeded, run->run));
  EXPECT_TRUE(Eventually([&] {
    return checks_.Count(Subject::kCalibration, VerificationOutcome::kAgrees) ==
           1;
  }));
  EXPECT_TRUE(Disagreements().empty());
}

TEST(VerificationSample, IsDrawnByNameWithItsShare) {
  int sampled = 0;
  constexpr int kNames = 10'000;
  for (int i = 0; i < kNames; ++i) {
    const std::string name = "rig/segments/s~" + std::to_string(i);
    const bool in = IsSampled(name, 0.1);
    sampled += in ? 1 : 0;
    EXPECT_FALSE(in && !IsSampled(name, 0.2));  // a larger share has more
    EXPECT_FALSE(IsSampled(name, 0));
    EXPECT_TRUE(IsSampled(name, 1));
  }
  // Four standard deviations of a binomial distribution.
  EXPECT_NEAR(sampled, 0.1 * kNames, 4 * std::sqrt(0.09 * kNames));
}

}  // namespace
}  // namespace selfcal::server
