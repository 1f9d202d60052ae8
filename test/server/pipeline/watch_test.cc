#include <atomic>
#include <mutex>

#include "server/pipeline/verdict.h"
#include "server/pipeline/watchers.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

// What a watcher was told, in order.
template <typename T>
class Told {
 public:
  void Add(T value) {
    const std::lock_guard lock(mutex_);
    values_.push_back(std::move(value));
  }
  std::vector<T> values() {
    const std::lock_guard lock(mutex_);
    return values_;
  }

 private:
  std::mutex mutex_;
  std::vector<T> values_;
};

class WatchTest : public PipelineTest {
 protected:
  std::unique_ptr<Subscription> Watch(Told<std::int64_t>* told) {
    auto subscription = pipeline_->WatchCalibration(
        "a", [told](const auto& active) { told->Add(active->version); });
    EXPECT_TRUE(subscription.ok()) << subscription.status();
    return *std::move(subscription);
  }

  void Recalibrate(std::int64_t run) {
    ASSERT_TRUE(pipeline_->StartRecalibration("a", true).ok());
    ASSERT_TRUE(RunIs(RunState::kSucceeded, run));
  }
};

TEST(Follows, ActivationsOfARigCountAndThoseOfANewOneAreNotTold) {
  StoredCalibration last;
  last.rig_key = 7;
  last.activation = 2;
  StoredCalibration next = last;
  EXPECT_FALSE(Follows(Remembered(last), next));
  next.activation = 1;
  EXPECT_FALSE(Follows(Remembered(last), next));
  next.activation = 3;
  EXPECT_TRUE(Follows(Remembered(last), next));
  // The rig was deleted and created again.
  next.rig_key = 8;
  EXPECT_FALSE(Follows(Remembered(last), next));
}

TEST(Follows, AVersionThatIsNotTrustworthyAnyMoreIsToldOnceMore) {
  StoredCalibration last;
  last.run = 1;
  last.verdict.kind = VerdictKind::kGood;
  StoredCalibration next = last;
  next.finding = "The two cores disagree.";
  EXPECT_TRUE(Follows(Remembered(last), next));
  EXPECT_FALSE(Follows(Remembered(next), next));
  // An update that was read before it comes late.
  EXPECT_FALSE(Follows(Remembered(next), last));
  // The device has changed, as well.
  StoredCalibration changed = next;
  changed.changed_since = 1;
  EXPECT_FALSE(Follows(Remembered(next), changed));
}

TEST_F(WatchTest, EachVersionIsToldOnceInOrder) {
  CreateRig();
  StartOne();
  Submit(0);
  ASSERT_TRUE(AllScored());
  Told<std::int64_t> early;
  Told<std::int64_t> late;
  const auto first = Watch(&early);
  EXPECT_THAT(early.values(), ::testing::ElementsAre(1));  // at once
  Recalibrate(1);
  Recalibrate(2);
  const auto second = Watch(&late);
  Recalibrate(3);
  ASSERT_TRUE(Eventually([&] { return late.values().size() == 2; }));
  ASSERT_TRUE(Eventually([&] { return early.values().size() == 4; }));
  EXPECT_THAT(early.values(), ::testing::ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(late.values(), ::testing::ElementsAre(3, 4));
}

TEST_F(WatchTest, ARollBackIsToldAsTheNewest) {
  CreateRig();
  StartOne();
  Submit(0);
  ASSERT_TRUE(AllScored());
  Told<std::int64_t> early;
  Told<std::int64_t> late;
  const auto first = Watch(&early);
  Recalibrate(1);
  Recalibrate(2);
  // A run has ended before its version is told; a roll-back in between would
  // take its place.
  ASSERT_TRUE(Eventually([&] { return early.values().size() == 3; }));
  ASSERT_TRUE(pipeline_->ActivateCalibration("a", 2, "me", "drifts").ok());
  const auto second = Watch(&late);
  // What is active is not told again.
  ASSERT_TRUE(pipeline_->ActivateCalibration("a", 2, "me", "twice").ok());
  ASSERT_TRUE(pipeline_->ActivateCalibration("a", 3, "me", "fine").ok());
  Recalibrate(3);
  ASSERT_TRUE(Eventually([&] { return early.values().size() == 6; }));
  ASSERT_TRUE(Eventually([&] { return late.values().size() == 3; }));
  EXPECT_THAT(early.values(), ::testing::ElementsAre(1, 2, 3, 2, 3, 4));
  EXPECT_THAT(late.values(), ::testing::ElementsAre(2, 3, 4));
  EXPECT_EQ(store_->GetCalibration("a", 4)->base_version, 3);
}

// As if a run had found that the version that stays active is biased.
TEST_F(WatchTest, ARunThatContradictsTheActiveVersionTellsItAgain) {
  CreateRig();
  std::atomic<bool> contradicts = false;
  const auto calibrate = estimators_.calibrate;
  estimators_.calibrate = [&, calibrate](const Rig& rig,
                                         const auto&... arguments) {
    auto result = calibrate(rig, arguments...);
    if (contradicts) {
      EXPECT_TRUE(domain_->ReportDisagreement("a", 2, "biased").ok());
      result->halves = {83.0, 26, 9e-8};  // it is rejected itself
    }
    return result;
  };
  StartOne();
  Submit(0);
  ASSERT_TRUE(AllScored());
  Recalibrate(1);
  Told<std::pair<std::int64_t, VerdictKind>> told;
  const auto watch = pipeline_->WatchCalibration("a", [&](const auto& active) {
    told.Add({active->version, VerdictOf(*active).kind});
  });
  ASSERT_TRUE(watch.ok()) << watch.status();
  ASSERT_EQ(told.values().size(), 1u);
  EXPECT_EQ(told.values()[0].first, 2);
  EXPECT_NE(told.values()[0].second, VerdictKind::kNotTrustworthy);
  contradicts = true;
  Recalibrate(2);
  ASSERT_TRUE(Eventually([&] { return told.values().size() == 2; }));
  EXPECT_EQ(told.values()[1],
            std::pair(std::int64_t{2}, VerdictKind::kNotTrustworthy));
}

// Activations by hand from two threads while a run publishes: in whatever order
// they are told of, a watcher ends with the active one.
TEST_F(WatchTest, WatchersEndWithTheActiveOneWhoeverActivates) {
  CreateRig();
  StartOne();
  Submit(0);
  ASSERT_TRUE(AllScored());
  Recalibrate(1);
  Told<std::int64_t> told;
  const auto watch = Watch(&told);
  const auto toggle = [&](std::int64_t version) {
    for (int k = 0; k < 20; ++k) {
      pipeline_->ActivateCalibration("a", version, "me", "test")
          .status()
          .IgnoreError();
    }
  };
  std::thread one(toggle, 1);
  std::thread two(toggle, 2);
  Recalibrate(2);
  one.join();
  two.join();
  const std::int64_t active = store_->GetActiveCalibration("a")->version;
  ASSERT_TRUE(Eventually([&] { return told.values().back() == active; }));
  const std::vector<std::int64_t> versions = told.values();
  EXPECT_GT(versions.size(), 2u);
}

TEST_F(WatchTest, WatchersThatComeDuringPublicationsMissNothing) {
  CreateRig();
  StartOne();
  Submit(0);
  ASSERT_TRUE(AllScored());
  std::vector<std::unique_ptr<Told<std::int64_t>>> told;
  std::vector<std::unique_ptr<Subscription>> subscriptions;
  for (int run = 1; run <= 5; ++run) {
    ASSERT_TRUE(pipeline_->StartRecalibration("a", true).ok());
    while (store_->GetRun("a", run)->state != RunState::kSucceeded) {
      told.push_back(std::make_unique<Told<std::int64_t>>());
      subscriptions.push_back(Watch(told.back().get()));
    }
  }
  for (const auto& one : told) {
    ASSERT_TRUE(Eventually([&] { return one->values().back() == 6; }));
    const std::vector<std::int64_t> versions = one->values();
    for (std::size_t k = 1; k < versions.size(); ++k) {
      EXPECT_EQ(versions[k], versions[k - 1] + 1);
    }
  }
}

TEST_F(WatchTest, NothingIsToldAfterTheEndOfASubscription) {
  CreateRig();
  StartOne();
  Submit(0);
  ASSERT_TRUE(AllScored());
  Told<std::int64_t> told;
  auto subscription = Watch(&told);
  subscription.reset();
  Recalibrate(1);
  EXPECT_THAT(told.values(), ::testing::ElementsAre(1));
  auto survivor = Watch(&told);
  pipeline_.reset();  // the pipeline may go first
  survivor.reset();
}

TEST_F(WatchTest, UnknownRigAndRunAreNotFound) {
  CreateRig();
  StartOne();
  EXPECT_TRUE(absl::IsNotFound(
      pipeline_->WatchCalibration("x", [](const auto&) {}).status()));
  EXPECT_TRUE(absl::IsNotFound(
      pipeline_->WatchRun("a", 1, [](const auto&) {}).status()));
}

TEST_F(WatchTest, RunIsToldFromItsStateToItsEnd) {
  CreateRig();
  std::mutex gate;
  gate.lock();
  estimators_.calibrate = [&](const Rig& rig,
                              const Calibration& start,
                              const auto&,
                              const auto&,
                              const ProgressCallback& progress,
                              const auto&) {
    const std::lock_guard wait(gate);
    for (int k = 1; k <= 3; ++k) progress({k, 3, 10.0 / k, 1.0});
    return Converged(rig, start);
  };
  StartOne();
  Submit(0);
  ASSERT_TRUE(AllScored());
  ASSERT_TRUE(pipeline_->StartRecalibration("a", true).ok());
  ASSERT_TRUE(RunIs(RunState::kRunning));
  Told<RunUpdate> told;
  const auto subscription = pipeline_->WatchRun(
      "a", 1, [&](const RunUpdate& update) { told.Add(update); });
  ASSERT_TRUE(subscription.ok());
  ASSERT_FALSE(told.values().empty());
  EXPECT_EQ(told.values().front().run.state, RunState::kRunning);
  gate.unlock();
  ASSERT_TRUE(Eventually(
      [&] { return told.values().back().run.state == RunState::kSucceeded; }));
  std::vector<int> iterations;
  for (const RunUpdate& update : told.values()) {
    if (update.run.state == RunState::kRunning &&
        update.progress.iteration > 0) {
      iterations.push_back(update.progress.iteration);
    }
  }
  EXPECT_THAT(iterations, ::testing::ElementsAre(1, 2, 3));
  EXPECT_EQ(told.values().back().run.calibration_version, 2);
  EXPECT_EQ(told.values().back().progress.iteration, 3);
}

TEST_F(WatchTest, WhoComesLateIsToldTheIterationsBefore) {
  CreateRig();
  std::mutex gate;
  gate.lock();
  std::atomic<bool> iterated{false};
  estimators_.calibrate = [&](const Rig& rig,
                              const Calibration& start,
                              const auto&,
                              const auto&,
                              const ProgressCallback& progress,
                              const auto&) {
    for (int k = 1; k <= 3; ++k) progress({k, 4, 10.0 / k, 1.0});
    // Says again where it is, as a solver that restarts.
    progress({3, 4, 10.0 / 3, 0.0});
    iterated = true;
    const std::lock_guard wait(gate);
    progress({4, 4, 2.5, 1.0});
    return Converged(rig, start);
  };
  StartOne();
  Submit(0);
  ASSERT_TRUE(AllScored());
  ASSERT_TRUE(pipeline_->StartRecalibration("a", true).ok());
  ASSERT_TRUE(Eventually([&] { return iterated.load(); }));
  Told<RunUpdate> told;
  const auto subscription = pipeline_->WatchRun(
      "a", 1, [&](const RunUpdate& update) { told.Add(update); });
  ASSERT_TRUE(subscription.ok());
  const RunUpdate first = told.values().at(0);
  EXPECT_EQ(first.progress.iteration, 3);
  EXPECT_EQ(first.progress.step_sigmas, 1.0);
  ASSERT_EQ(first.missed.size(), 2u);
  EXPECT_EQ(first.missed[0].cost, 10.0);
  EXPECT_EQ(first.missed[1].cost, 5.0);
  gate.unlock();
  ASSERT_TRUE(Eventually(
      [&] { return told.values().back().run.state == RunState::kSucceeded; }));
  EXPECT_TRUE(told.values().back().missed.empty());
}

TEST_F(WatchTest, EndedRunIsToldOnce) {
  CreateRig();
  StartOne();
  Submit(0);
  ASSERT_TRUE(AllScored());
  Recalibrate(1);
  Told<RunUpdate> told;
  const auto subscription = pipeline_->WatchRun(
      "a", 1, [&](const RunUpdate& update) { told.Add(update); });
  Recalibrate(2);
  ASSERT_EQ(told.values().size(), 1u);
  EXPECT_EQ(told.values()[0].run.state, RunState::kSucceeded);
}

}  // namespace
}  // namespace selfcal::server
