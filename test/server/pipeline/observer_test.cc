#include "server/pipeline/observer.h"

#include <map>
#include <mutex>

#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

using Observed = PipelineObserver::Verdict;

class Recorder final : public PipelineObserver {
 public:
  void OnVerdict(const std::string& rig, Observed verdict) override {
    const std::lock_guard lock(mutex_);
    ++verdicts_[{rig, verdict}];
  }
  void OnScore(const SegmentInformation& information, double seconds) override {
    const std::lock_guard lock(mutex_);
    scores_ += !information.groups.empty() && seconds >= 0;
  }
  void OnRun(const StoredRun& run) override {
    const std::lock_guard lock(mutex_);
    runs_.push_back(run.state);
  }
  void OnCheck(CheckSubject, VerificationOutcome) override {}

  int Count(const std::string& rig, Observed verdict) {
    const std::lock_guard lock(mutex_);
    return verdicts_[{rig, verdict}];
  }
  int scores() {
    const std::lock_guard lock(mutex_);
    return scores_;
  }
  std::vector<RunState> runs() {
    const std::lock_guard lock(mutex_);
    return runs_;
  }

 private:
  std::mutex mutex_;
  std::map<std::pair<std::string, Observed>, int> verdicts_;
  int scores_ = 0;
  std::vector<RunState> runs_;
};

class ObserverTest : public PipelineTest {
 protected:
  ~ObserverTest() override { pipeline_.reset(); }
  Recorder recorder_;
};

TEST_F(ObserverTest, IsToldOfVerdictsScoresAndRuns) {
  options_.observer = &recorder_;
  StartOne();
  CreateRig();
  Submit(0);
  Submit(0);
  MotionSegment invalid = Segment(1);
  invalid.keyframes.clear();
  ASSERT_TRUE(pipeline_->Submit("a", invalid, nullptr).ok());
  ASSERT_FALSE(pipeline_->Submit("nobody", Segment(1), nullptr).ok());
  EXPECT_EQ(recorder_.Count("a", Observed::kStored), 1);
  EXPECT_EQ(recorder_.Count("a", Observed::kDuplicate), 1);
  EXPECT_EQ(recorder_.Count("a", Observed::kRejected), 1);
  EXPECT_EQ(recorder_.Count("nobody", Observed::kFailed), 1);
  ASSERT_TRUE(AllScored());
  EXPECT_EQ(recorder_.scores(), 1);
  ASSERT_TRUE(pipeline_->StartRecalibration("a").ok());
  ASSERT_TRUE(Eventually([&] {
    const auto runs = recorder_.runs();
    return !runs.empty() && runs.back() == RunState::kSucceeded;
  }));
  const auto runs = recorder_.runs();
  EXPECT_EQ(runs.front(), RunState::kRunning);
  EXPECT_EQ(std::count(runs.begin(), runs.end(), RunState::kSucceeded), 1);
}

}  // namespace
}  // namespace selfcal::server
