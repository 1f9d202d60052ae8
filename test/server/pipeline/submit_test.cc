#include <algorithm>
#include <atomic>
#include <memory>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "test/server/pipeline/pipeline_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

class SubmitTest : public PipelineTest {
 protected:
  // Scores wait for the gate, which they keep: the data of a segment remains
  // until then.
  void ScoreBehind(const std::shared_ptr<std::mutex>& gate) {
    estimators_.score = [gate](
                            const Rig& rig, const auto&, const auto& segment) {
      const std::lock_guard wait(*gate);
      return FakeInformation(rig, EntropyOf(segment.key.index));
    };
  }
};

using SubmitVerdict = SubmitResult::Verdict;

TEST_F(SubmitTest, StoredThenDuplicate) {
  CreateRig();
  StartOne();
  EXPECT_EQ(Submit(0), SubmitVerdict::kStored);
  EXPECT_EQ(Submit(0), SubmitVerdict::kDuplicate);
  ASSERT_TRUE(AllScored());
  EXPECT_EQ(Submit(0), SubmitVerdict::kDuplicate);
  EXPECT_EQ(store_->ListSegments("a", {})->items.size(), 1u);
}

TEST_F(SubmitTest, UnknownRigIsNotFound) {
  StartOne();
  EXPECT_TRUE(
      absl::IsNotFound(pipeline_->Submit("x", Segment(0), nullptr).status()));
}

TEST_F(SubmitTest, RejectionNamesEveryFieldAndStoresNothing) {
  CreateRig();
  StartOne();
  MotionSegment bad = Segment(0);
  bad.calibration_version = 7;
  bad.keyframes[2].q_GI.coeffs() *= 1.1;
  const auto result = pipeline_->Submit("a", bad, nullptr);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->verdict, SubmitVerdict::kRejected);
  std::set<std::string> fields;
  for (const Violation& violation : result->violations) {
    fields.insert(violation.field);
  }
  EXPECT_EQ(fields.count("calibration_version"), 1u);
  EXPECT_EQ(fields.size(), 2u);
  EXPECT_TRUE(store_->ListSegments("a", {})->items.empty());
}

TEST_F(SubmitTest, AFewObservationsOutsideTheImageAreLeftOutAndCounted) {
  CreateRig();
  const auto gate = std::make_shared<std::mutex>();
  std::unique_lock hold(*gate);
  ScoreBehind(gate);
  StartOne();
  MotionSegment segment = Segment(0);
  const std::size_t count = segment.observations.size();
  ASSERT_GT(count, 150u);
  segment.observations[7].z_px.x() = -3;
  segment.observations[120].z_px.y() = 1e4;
  const auto result = pipeline_->Submit("a", segment, nullptr);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->verdict, SubmitVerdict::kStored);
  EXPECT_EQ(result->observations_dropped, 2u);
  const auto stored = store_->GetSegmentData("a", segment.key);
  EXPECT_TRUE(stored.ok()) << stored.status();
  if (stored.ok()) {
    EXPECT_EQ(stored->observations.size(), count - 2);
    EXPECT_EQ(stored->landmarks.size(), segment.landmarks.size());
  }
  const auto again = pipeline_->Submit("a", segment, nullptr);
  hold.unlock();
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->verdict, SubmitVerdict::kDuplicate);
  EXPECT_EQ(again->observations_dropped, 0u);
}

TEST_F(SubmitTest, SaturatedReadingsAreLeftOutAndCounted) {
  CreateRig();
  const auto gate = std::make_shared<std::mutex>();
  std::unique_lock hold(*gate);
  ScoreBehind(gate);
  StartOne();
  MotionSegment segment = Segment(0);
  const std::size_t count = segment.imu.size();
  ASSERT_GT(count, 50u);
  segment.imu[count / 2].gyro.x() = 999;
  const auto result = pipeline_->Submit("a", segment, nullptr);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->verdict, SubmitVerdict::kStored);
  EXPECT_EQ(result->readings_dropped, 1u);
  const auto stored = store_->GetSegmentData("a", segment.key);
  hold.unlock();
  ASSERT_TRUE(stored.ok()) << stored.status();
  EXPECT_EQ(stored->imu.size(), count - 1);
}

TEST_F(SubmitTest, ManySaturatedReadingsRejectTheSegment) {
  CreateRig();
  StartOne();
  MotionSegment segment = Segment(0);
  // Degrees taken for radians.
  for (std::size_t k = 0; k < segment.imu.size(); k += 10) {
    segment.imu[k].gyro.x() = 90;
  }
  const auto result = pipeline_->Submit("a", segment, nullptr);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->verdict, SubmitVerdict::kRejected);
  ASSERT_EQ(result->violations.size(), 1u);
  EXPECT_EQ(result->violations[0].field, "imu");
  EXPECT_NE(result->violations[0].message.find("imu.gyro_max"),
            std::string::npos);
}

TEST_F(SubmitTest, ManySaturatedReadingsOfASecondImuNameIt) {
  CreateRig();
  StartOne();
  MotionSegment segment = Segment(0);
  segment.imu1 = segment.imu;
  for (std::size_t k = 0; k < segment.imu1.size(); k += 10) {
    segment.imu1[k].gyro.x() = 90;
  }
  const auto result = pipeline_->Submit("a", segment, nullptr);
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->violations.size(), 1u);
  EXPECT_EQ(result->violations[0].field, "imu1");
  EXPECT_NE(result->violations[0].message.find("imu1.gyro_max"),
            std::string::npos);
}

TEST_F(SubmitTest, ManyObservationsOutsideTheImageRejectTheSegment) {
  CreateRig();
  StartOne();
  MotionSegment segment = Segment(0);
  for (std::size_t i = 0; i < segment.observations.size(); i += 20) {
    segment.observations[i].z_px.x() = 5000;
  }
  const auto result = pipeline_->Submit("a", segment, nullptr);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->verdict, SubmitVerdict::kRejected);
  EXPECT_EQ(result->observations_dropped, 0u);
  ASSERT_FALSE(result->violations.empty());
  EXPECT_EQ(result->violations[0].field, "observations[0].z_px");
}

TEST_F(SubmitTest, VersionBelowOneIsNamedOnce) {
  CreateRig();
  StartOne();
  MotionSegment bad = Segment(0);
  bad.calibration_version = 0;
  const auto result = pipeline_->Submit("a", bad, nullptr);
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->violations.size(), 1u);
  EXPECT_EQ(result->violations[0].field, "calibration_version");
}

TEST_F(SubmitTest, NotStartedOrStoppedIsUnavailable) {
  CreateRig();
  MakeOne();
  EXPECT_TRUE(absl::IsUnavailable(
      pipeline_->Submit("a", Segment(0), nullptr).status()));
  ASSERT_TRUE(pipeline_->Start().ok());
  EXPECT_EQ(Submit(0), SubmitVerdict::kStored);
  pipeline_->Stop();
  EXPECT_TRUE(absl::IsUnavailable(
      pipeline_->Submit("a", Segment(1), nullptr).status()));
}

TEST_F(SubmitTest, WaitsWhileTheBacklogIsFullUntilCancelled) {
  CreateRig();
  options_.max_backlog = 3;
  std::mutex gate;
  gate.lock();
  estimators_.score = [&](const Rig& rig, const auto&, const auto& segment) {
    const std::lock_guard wait(gate);
    return FakeInformation(rig, EntropyOf(segment.key.index));
  };
  StartOne();
  for (int k = 0; k < 3; ++k) EXPECT_EQ(Submit(k), SubmitVerdict::kStored);
  int asked = 0;
  const auto cancelled =
      pipeline_->Submit("a", Segment(3), [&] { return ++asked > 2; });
  EXPECT_TRUE(absl::IsCancelled(cancelled.status())) << cancelled.status();
  EXPECT_EQ(store_->ListSegments("a", {})->items.size(), 3u);
  gate.unlock();
  EXPECT_EQ(Submit(3), SubmitVerdict::kStored);  // now there is room
  EXPECT_TRUE(AllScored());
  pipeline_->Stop();  // a run may still score what it holds out
}

// One that sends fast takes nobody's place.
TEST_F(SubmitTest, WhoWaitsLongestIsNext) {
  CreateRig();
  options_.max_backlog = 1;
  std::mutex gate;
  gate.lock();
  std::vector<std::int64_t> scored;
  estimators_.score = [&](const Rig& rig, const auto&, const auto& segment) {
    const std::lock_guard wait(gate);
    // A run scores what it holds out again.
    const std::int64_t index = segment.key.index;
    if (std::find(scored.begin(), scored.end(), index) == scored.end()) {
      scored.push_back(index);
    }
    return FakeInformation(rig, EntropyOf(index));
  };
  StartOne();
  EXPECT_EQ(Submit(0), SubmitVerdict::kStored);
  std::vector<std::thread> senders;
  for (int k = 1; k <= 8; ++k) {
    std::atomic<bool> waits = false;
    senders.emplace_back([this, k, &waits] {
      const auto result = pipeline_->Submit("a", Segment(k), [&waits] {
        static thread_local bool first = true;
        if (first) waits = true;
        first = false;
        return false;
      });
      EXPECT_TRUE(result.ok()) << result.status();
    });
    EXPECT_TRUE(Eventually([&] { return waits.load(); }));
  }
  gate.unlock();
  for (std::thread& sender : senders) sender.join();
  ASSERT_TRUE(AllScored());
  pipeline_->Stop();
  EXPECT_THAT(scored, ::testing::ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8));
}

// A change of the prior scores kept segments again; this one is not among them.
TEST_F(SubmitTest, AScoreOfAnOutdatedPriorIsComputedAgain) {
  CreateRig();
  const auto gate = std::make_shared<std::mutex>();
  const auto begun = std::make_shared<std::atomic<int>>(0);
  std::unique_lock hold(*gate);
  estimators_.score = [=](const Rig& rig, const auto&, const auto&) {
    ++*begun;
    const std::lock_guard wait(*gate);
    return FakeInformation(rig, rig.prior_sigmas.empty() ? 5.0 : 3.0);
  };
  estimators_.ends = CoreEstimators().ends;
  StartOne();
  EXPECT_EQ(Submit(0), SubmitVerdict::kStored);
  ASSERT_TRUE(Eventually([&] { return *begun == 1; }));
  const auto updated = domain_->UpdateRig(
      "a",
      [](StoredRig rig) -> absl::StatusOr<StoredRig> {
        rig.rig.prior_sigmas = {{"cam0.focal.*", 3.0}};
        return rig;
      },
      "operator");
  ASSERT_TRUE(updated.ok()) << updated.status();
  hold.unlock();
  EXPECT_TRUE(Eventually([&] {
    const auto tables = store_->GetTables("a");
    return tables.ok() && (*tables)[0].entries.size() == 1 &&
           (*tables)[0].entries[0].entropy == 3.0;
  }));
  EXPECT_EQ(*begun, 2);
}

}  // namespace
}  // namespace selfcal::server
