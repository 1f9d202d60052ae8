// The life of a calibration: what may become what, by whom, and what is told.
#include <atomic>
#include <map>
#include <random>
#include <thread>

#include "test/promise.h"
#include "test/server/store/store_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class LifecycleTest : public StoreTest {
 protected:
  LifecycleTest() : rig_(CreateTestRig("a")) {
    Put("a", 0);
    Score(rig_, 0, 1.0);
  }

  StoredCalibration Found(CalibrationState verdict) const {
    StoredCalibration found;
    found.state = verdict;
    found.theta = rig_.factory;
    found.theta.cameras[0].f.x() += 1;
    const int size = TangentSize(rig_.factory);
    found.covariance = Eigen::MatrixXd::Identity(size, size);
    found.settings = {{"loss", "huber"}, {"solver", "structured"}};
    found.report = CalibrationResult();
    found.report->status = CalibrateStatus::kConverged;
    return found;
  }

  StoredRun Begin() {
    const auto run = domain_->CreateManualRun("a", true);
    EXPECT_TRUE(run.ok()) << run.status();
    const auto begun = domain_->BeginRun("a", run->run);
    EXPECT_TRUE(begun.ok()) << begun.status();
    return *begun;
  }

  StoredCalibration Finish(CalibrationState verdict) {
    const StoredRun run = Begin();
    const auto finished = domain_->FinishRun("a", run.run, Found(verdict));
    EXPECT_TRUE(finished.ok()) << finished.status();
    return *finished;
  }

  CalibrationState StateOf(std::int64_t version) {
    return store_->GetCalibration("a", version)->state;
  }

  StoredEvent LastEvent() {
    return store_->ListEvents({1000, ""})->items.back();
  }

  const Rig rig_;
};
SELFCAL_STORE_TEST_SUITE(LifecycleTest);

TEST_P(LifecycleTest, IterationsOfARunAreKeptWithItsCandidate) {
  const StoredRun run = Begin();
  StoredCalibration found = Found(CalibrationState::kCandidate);
  const auto size = found.covariance.rows();
  for (int k = 1; k <= 2; ++k) {
    CalibrateProgress step;
    step.iteration = k;
    step.max_iterations = 30;
    step.cost = 10.5 / k;
    step.step_sigmas = 0.25 / k;
    step.theta = found.theta;
    step.moved = Eigen::VectorXd::Constant(size, 0.5 * k);
    step.sigmas = Eigen::VectorXd::Constant(size, 2.0 * k);
    found.steps.push_back(step);
  }
  ASSERT_TRUE(domain_->StoreCandidate("a", run.run, found).ok());
  Reopen();
  const auto kept = store_->GetCandidate("a", run.run);
  ASSERT_TRUE(kept.ok()) << kept.status();
  ASSERT_EQ(kept->steps.size(), 2u);
  for (int k = 0; k < 2; ++k) {
    EXPECT_EQ(kept->steps[k].iteration, found.steps[k].iteration);
    EXPECT_EQ(kept->steps[k].max_iterations, 30);
    EXPECT_EQ(kept->steps[k].cost, found.steps[k].cost);
    EXPECT_EQ(kept->steps[k].step_sigmas, found.steps[k].step_sigmas);
    ExpectSameCalibration(kept->steps[k].theta, found.steps[k].theta);
    EXPECT_EQ(kept->steps[k].moved, found.steps[k].moved);
    EXPECT_EQ(kept->steps[k].sigmas, found.steps[k].sigmas);
  }
}

TEST_P(LifecycleTest, CandidateIsKeptUntilItIsJudged) {
  const StoredRun run = Begin();
  EXPECT_TRUE(absl::IsNotFound(store_->GetCandidate("a", run.run).status()));
  const auto candidate = domain_->StoreCandidate(
      "a", run.run, Found(CalibrationState::kCandidate));
  ASSERT_TRUE(candidate.ok()) << candidate.status();
  EXPECT_EQ(candidate->version, 2);
  Reopen();
  const auto kept = store_->GetCandidate("a", run.run);
  ASSERT_TRUE(kept.ok()) << kept.status();
  EXPECT_EQ(kept->state, CalibrationState::kCandidate);
  EXPECT_EQ(kept->activation, 0);
  EXPECT_FALSE(store_->WasActive("a", kept->version).value());
  EXPECT_TRUE(store_->WasActive("a", 1).value());
  EXPECT_TRUE(
      absl::IsNotFound(store_->WasActive("a", kept->version + 1).status()));
  EXPECT_TRUE(absl::IsNotFound(store_->WasActive("nobody", 1).status()));
  EXPECT_EQ(kept->schema_version, GetParam().schema_version);
  EXPECT_EQ(kept->settings, candidate->settings);
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 1);
  // A second one changes nothing.
  EXPECT_EQ(
      domain_->StoreCandidate("a", run.run, Found(CalibrationState::kCandidate))
          ->version,
      2);
  ASSERT_TRUE(
      domain_->FinishRun("a", run.run, Found(CalibrationState::kActive)).ok());
  EXPECT_EQ(StateOf(2), CalibrationState::kActive);
  EXPECT_EQ(store_->ListCalibrations("a", {})->items.size(), 2u);
  EXPECT_TRUE(absl::IsNotFound(store_->GetCandidate("a", run.run).status()));
}

TEST_P(LifecycleTest, CandidateOfARunThatEndsOtherwiseIsRejected) {
  const StoredRun run = Begin();
  ASSERT_TRUE(
      domain_->StoreCandidate("a", run.run, Found(CalibrationState::kCandidate))
          .ok());
  ASSERT_TRUE(
      domain_->EndRun("a", run.run, RunState::kCancelled, "by hand").ok());
  const auto rejected = store_->GetCalibration("a", 2);
  EXPECT_EQ(rejected->state, CalibrationState::kRejected);
  ASSERT_EQ(rejected->reasons.size(), 1u);
  EXPECT_THAT(rejected->reasons[0], HasSubstr("by hand"));
}

TEST_P(LifecycleTest, FindingOfTheActiveVersionIsKeptWithItAndIsOneMoreReason) {
  Finish(CalibrationState::kActive);
  const StoredRun run = Begin();
  StoredCalibration validated = Found(CalibrationState::kRejected);
  validated.reasons = {"an effect shifts it"};
  ASSERT_TRUE(
      domain_->FinishRun("a", run.run, validated, "by 3 of its sigmas").ok());
  Reopen();
  const auto active = store_->GetActiveCalibration("a");
  EXPECT_EQ(active->version, 2);
  EXPECT_EQ(active->finding, "by 3 of its sigmas");
  const auto rejected = store_->GetCalibration("a", 3);
  EXPECT_EQ(rejected->finding, "");
  EXPECT_THAT(rejected->reasons,
              ElementsAre("an effect shifts it",
                          AllOf(HasSubstr("Version 2"),
                                HasSubstr("by 3 of its sigmas"))));
}

TEST_P(LifecycleTest, RejectedOneKeepsReasonsAndFigures) {
  const StoredRun run = Begin();
  StoredCalibration validated = Found(CalibrationState::kRejected);
  validated.reasons = {"does not fit"};
  StoredValidation validation;
  validation.active_version = 1;
  validation.checks = {
      {"converged", 1, 1, CheckOutcome::kPassed, "noted"},
      {"halves", 0, 1e-4, CheckOutcome::kNotTested, "too few segments"},
      {"held_out_probability", 1e-9, 1e-4, CheckOutcome::kFailed, "no fit"}};
  validation.held_out = {5, 3, {123.5, 26, 1e-9}, {21.5, 26, 0.7}, 2};
  validated.verdict = {VerdictKind::kNotTrustworthy, {"does not fit"}};
  validated.validation = validation;
  ASSERT_TRUE(domain_->FinishRun("a", run.run, validated).ok());
  Reopen();
  const auto kept = store_->GetCalibration("a", 2);
  EXPECT_EQ(kept->state, CalibrationState::kRejected);
  EXPECT_THAT(kept->reasons, ElementsAre("does not fit"));
  ASSERT_TRUE(kept->validation.has_value());
  EXPECT_EQ(kept->validation->active_version, 1);
  ASSERT_EQ(kept->validation->checks.size(), 3u);
  EXPECT_EQ(kept->validation->checks[0].outcome, CheckOutcome::kPassed);
  EXPECT_EQ(kept->validation->checks[0].sentence, "noted");
  EXPECT_EQ(kept->validation->checks[1].outcome, CheckOutcome::kNotTested);
  EXPECT_EQ(kept->validation->checks[2].name, "held_out_probability");
  EXPECT_EQ(kept->validation->checks[2].value, 1e-9);
  EXPECT_EQ(kept->validation->checks[2].outcome, CheckOutcome::kFailed);
  EXPECT_EQ(kept->verdict.kind, VerdictKind::kNotTrustworthy);
  EXPECT_THAT(kept->verdict.sentences, ElementsAre("does not fit"));
  EXPECT_EQ(kept->validation->held_out.rescored, 2);
  EXPECT_EQ(kept->validation->held_out.segments, 5);
  EXPECT_EQ(kept->validation->held_out.left_out, 3);
  EXPECT_EQ(kept->validation->held_out.candidate.statistic, 123.5);
  EXPECT_EQ(kept->validation->held_out.active.probability, 0.7);
}

TEST_P(LifecycleTest, OneJudgedAgainstAnotherThanTheActiveIsJudgedAgain) {
  Finish(CalibrationState::kActive);
  const StoredRun run = Begin();
  StoredCalibration validated = Found(CalibrationState::kActive);
  validated.validation = StoredValidation();
  validated.validation->active_version = 2;
  ASSERT_TRUE(domain_->ActivateCalibration("a", 1, "me", "drifts").ok());
  EXPECT_TRUE(
      absl::IsAborted(domain_->FinishRun("a", run.run, validated).status()));
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 1);
  validated.validation->active_version = 1;
  ASSERT_TRUE(domain_->FinishRun("a", run.run, validated).ok());
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 3);
}

TEST_P(LifecycleTest, RollBackIsLoggedWithWhoAndWhy) {
  Finish(CalibrationState::kActive);
  const auto active =
      domain_->ActivateCalibration("a", 1, "cn=operator", "it drifts");
  ASSERT_TRUE(active.ok()) << active.status();
  EXPECT_EQ(active->state, CalibrationState::kActive);
  EXPECT_EQ(StateOf(2), CalibrationState::kRolledBack);
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 1);
  EXPECT_EQ(LastEvent().kind, EventKind::kCalibrationRolledBack);
  EXPECT_THAT(LastEvent().detail, HasSubstr("cn=operator"));
  EXPECT_THAT(LastEvent().detail, HasSubstr("it drifts"));
  EXPECT_GT(active->activation, store_->GetCalibration("a", 2)->activation);
  // And forth again.
  ASSERT_TRUE(domain_->ActivateCalibration("a", 2, "me", "it does not").ok());
  EXPECT_EQ(StateOf(1), CalibrationState::kSuperseded);
  EXPECT_EQ(StateOf(2), CalibrationState::kActive);
  EXPECT_EQ(LastEvent().kind, EventKind::kCalibrationActivated);
}

TEST_P(LifecycleTest, ActivatingTheActiveOneChangesNothing) {
  Finish(CalibrationState::kActive);
  const StoredEvent last = LastEvent();
  const auto before = store_->GetActiveCalibration("a");
  const auto again = domain_->ActivateCalibration("a", 2, "me", "twice");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->activation, before->activation);
  EXPECT_EQ(LastEvent().event, last.event);
}

TEST_P(LifecycleTest, WhatWasNeverValidatedIsNotActivated) {
  Finish(CalibrationState::kRejected);
  const StoredRun run = Begin();
  ASSERT_TRUE(
      domain_->StoreCandidate("a", run.run, Found(CalibrationState::kCandidate))
          .ok());
  for (const std::int64_t version : {2, 3}) {
    EXPECT_TRUE(absl::IsFailedPrecondition(
        domain_->ActivateCalibration("a", version, "me", "why not").status()))
        << version;
  }
  EXPECT_TRUE(absl::IsNotFound(
      domain_->ActivateCalibration("a", 9, "me", "why not").status()));
  EXPECT_EQ(store_->GetActiveCalibration("a")->version, 1);
}

TEST_P(LifecycleTest, NextRunStartsFromTheOneThatWasMadeActive) {
  Finish(CalibrationState::kActive);
  Finish(CalibrationState::kActive);
  ASSERT_TRUE(domain_->ActivateCalibration("a", 2, "me", "3 drifts").ok());
  EXPECT_EQ(Begin().base_version, 2);
}

// While versions are made, and made active to and fro.
TEST_P(LifecycleTest, AVersionReadsTheSameForEver) {
  std::atomic<bool> done{false};
  std::atomic<int> reads{0};
  std::atomic<int> changed{0};
  const auto read = [&](unsigned seed) {
    std::mt19937 random(seed);
    std::map<std::int64_t, StoredCalibration> first;
    while (!done) {
      const std::int64_t newest =
          store_->ListCalibrations("a", {1, ""})->items.front().version;
      const std::int64_t version =
          std::uniform_int_distribution<std::int64_t>(1, newest)(random);
      const auto now = store_->GetCalibration("a", version);
      if (!now.ok()) {
        ++changed;
        continue;
      }
      const auto known = first.emplace(version, *now).first->second;
      const bool same =
          ReadableValues(known.theta) == ReadableValues(now->theta) &&
          known.covariance == now->covariance &&
          known.create_time_ns == now->create_time_ns &&
          known.segments == now->segments && known.run == now->run;
      changed += same ? 0 : 1;
      ++reads;
    }
  };
  std::thread one(read, 1);
  std::thread two(read, 2);
  const int trials = Trials(10);
  for (int k = 0; k < trials; ++k) {
    const StoredCalibration made = Finish(
        k % 3 == 0 ? CalibrationState::kRejected : CalibrationState::kActive);
    if (k % 4 == 3) {
      EXPECT_TRUE(domain_->ActivateCalibration("a", 1, "me", "test").ok());
    }
    EXPECT_EQ(made.version, k + 2);
  }
  EXPECT_TRUE(Eventually([&] { return reads > 0 || changed > 0; }));
  done = true;
  one.join();
  two.join();
  EXPECT_EQ(changed, 0);
  Promise promise("a calibration version never changes");
  promise.trials = reads;
  promise.lost = changed;
}

}  // namespace
}  // namespace selfcal::server
