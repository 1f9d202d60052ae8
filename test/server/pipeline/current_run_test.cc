#include "server/pipeline/current_run.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::minutes;

StoredRun TestRun() {
  StoredRun run;
  run.rig = "a";
  run.run = 7;
  return run;
}

CalibrateProgress Step(int iteration, double cost) {
  CalibrateProgress progress;
  progress.iteration = iteration;
  progress.cost = cost;
  return progress;
}

class CurrentRunTest : public ::testing::Test {
 protected:
  CurrentRunTest() { current_.Open(); }

  void Begin() {
    const auto begun = current_.Begin([] { return TestRun(); });
    ASSERT_TRUE(begun && begun->ok());
  }

  CurrentRun current_;
};

TEST_F(CurrentRunTest, NoneBeginsBeforeOpenOrAfterClose) {
  bool called = false;
  const auto begin = [&] {
    called = true;
    return TestRun();
  };
  CurrentRun never_open;
  EXPECT_FALSE(never_open.Begin(begin));
  current_.Close();
  EXPECT_FALSE(current_.Begin(begin));
  EXPECT_FALSE(called);
}

TEST_F(CurrentRunTest, ARunThatCannotBeginIsNotTheCurrentOne) {
  const auto begun = current_.Begin([]() -> absl::StatusOr<StoredRun> {
    return absl::FailedPreconditionError("cancelled");
  });
  ASSERT_TRUE(begun);
  EXPECT_TRUE(absl::IsFailedPrecondition(begun->status()));
  bool otherwise = false;
  EXPECT_FALSE(current_.Cancel("a", 7, [&] { otherwise = true; }));
  EXPECT_TRUE(otherwise);
}

TEST_F(CurrentRunTest, KeepsTheFirstReportOfEachIterationUntilItsEnd) {
  Begin();
  for (const auto& step : {Step(0, 9), Step(0, 8), Step(1, 5), Step(0, 4)}) {
    current_.AddStep(step);
  }
  const auto steps = current_.StepsOf("a", 7);
  ASSERT_EQ(steps.size(), 2u);
  EXPECT_EQ(steps[0].cost, 9);
  EXPECT_EQ(steps[1].cost, 5);
  EXPECT_TRUE(current_.StepsOf("a", 8).empty());
  EXPECT_TRUE(current_.StepsOf("b", 7).empty());
  current_.End();
  EXPECT_TRUE(current_.StepsOf("a", 7).empty());
}

TEST_F(CurrentRunTest, CancelInterruptsItAndWaitsForItsEnd) {
  Begin();
  EXPECT_FALSE(current_.interrupted());
  std::atomic<bool> returned = false;
  std::thread canceller([&] {
    EXPECT_TRUE(current_.Cancel("a", 7, [] { FAIL() << "it is current"; }));
    returned = true;
  });
  EXPECT_TRUE(Eventually([&] { return current_.cancelled(); }));
  EXPECT_TRUE(current_.interrupted());
  EXPECT_FALSE(current_.Pause(minutes(1)));
  EXPECT_FALSE(returned);
  current_.End();
  canceller.join();
  EXPECT_FALSE(current_.interrupted()) << "the next run is not cancelled";
}

TEST_F(CurrentRunTest, CloseInterruptsItWithoutCancelling) {
  Begin();
  EXPECT_TRUE(current_.Pause(milliseconds(1)));
  current_.Close();
  EXPECT_FALSE(current_.Pause(minutes(1)));
  EXPECT_TRUE(current_.interrupted());
  EXPECT_FALSE(current_.cancelled());
}

TEST_F(CurrentRunTest, RetriesWhatIsTransientUntilInterrupted) {
  Begin();
  int calls = 0;
  const auto stored = RetryUnlessInterrupted(
      &current_, [&]() -> absl::StatusOr<StoredCalibration> {
        if (++calls < 3) return absl::UnavailableError("the disk is full");
        return StoredCalibration();
      });
  EXPECT_TRUE(stored.ok());
  EXPECT_EQ(calls, 3);
  const auto failed = RetryUnlessInterrupted(
      &current_, [&]() -> absl::StatusOr<StoredCalibration> {
        ++calls;
        return absl::NotFoundError("gone");
      });
  EXPECT_TRUE(absl::IsNotFound(failed.status()));
  EXPECT_EQ(calls, 4);
  current_.Close();
  const auto unavailable = RetryUnlessInterrupted(
      &current_, [&]() -> absl::StatusOr<StoredCalibration> {
        ++calls;
        return absl::UnavailableError("the disk is full");
      });
  EXPECT_TRUE(absl::IsUnavailable(unavailable.status()));
  EXPECT_EQ(calls, 5);
}

}  // namespace
}  // namespace selfcal::server
