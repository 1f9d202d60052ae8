// A device is knocked in the middle of its life: the whole way, simulated.
#include <mutex>
#include <utility>
#include <vector>

#include "core/model/so3.h"
#include "server/pipeline/verdict.h"
#include "test/server/pipeline/pipeline_test.h"

namespace selfcal::server {
namespace {

class ChangePipelineTest : public PipelineTest {
 protected:
  ChangePipelineTest() { estimators_ = CoreEstimators(); }

  // Segments of a session of the device as it is, estimated with a version.
  std::vector<MotionSegment> Session(const Rig& rig,
                                     const Calibration& truth,
                                     const StoredCalibration& version,
                                     int count,
                                     const std::string& session,
                                     std::uint64_t seed) const {
    SimulationOptions options;
    options.seed = seed;
    options.keyframes_per_segment = 20;
    options.landmarks_in_view = 50;
    auto segments = Simulate(rig,
                             truth,
                             version.theta,
                             *MakeHandheld(2.0 * count + 1, 1.0, seed),
                             session,
                             options)
                        .segments;
    segments.resize(count);
    for (MotionSegment& segment : segments) {
      segment.calibration_version = version.version;
    }
    return segments;
  }

  void SubmitAll(const std::vector<MotionSegment>& segments) {
    for (const MotionSegment& segment : segments) {
      const auto result = pipeline_->Submit("a", segment, nullptr);
      ASSERT_TRUE(result.ok()) << result.status();
      ASSERT_EQ(result->verdict, SubmitResult::Verdict::kStored);
    }
    ASSERT_TRUE(AllScored());
    ASSERT_TRUE(
        Eventually([&] { return store_->ListUnfinishedRuns()->empty(); }));
  }

  int CountEvents(EventKind kind) const {
    const auto events = store_->ListEvents({1000, ""});
    return static_cast<int>(std::count_if(
        events->items.begin(), events->items.end(), [&](const auto& event) {
          return event.kind == kind;
        }));
  }
};

TEST_F(ChangePipelineTest, AKnockedDeviceIsCalibratedOnWhatCameAfterIt) {
  Rig rig = HandheldRig("a");
  const Calibration truth = rig.factory;
  rig.factory = PerturbCalibration(truth, {}, 1);
  rig.table_size = 4;
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  StartOne();
  const auto factory = store_->GetActiveCalibration("a");
  SubmitAll(Session(rig, truth, *factory, 6, "first", 1));
  const auto before = store_->GetActiveCalibration("a");
  ASSERT_TRUE(before.ok());
  ASSERT_GT(before->version, 1);
  SubmitAll(Session(rig, truth, *before, 6, "before", 2));
  ASSERT_EQ(CountEvents(EventKind::kChangeDetected), 0);
  const auto last = store_->GetActiveCalibration("a");
  std::mutex mutex;
  std::vector<std::pair<std::int64_t, VerdictKind>> told;
  const auto watch = pipeline_->WatchCalibration("a", [&](const auto& active) {
    const std::lock_guard lock(mutex);
    told.emplace_back(active->version, VerdictOf(*active).kind);
  });
  ASSERT_TRUE(watch.ok()) << watch.status();

  Calibration knocked = truth;
  CameraCalibration& camera = knocked.cameras[0];
  camera.q_CI = camera.q_CI * Exp({0.01, -0.01, 0.01});
  SubmitAll(Session(rig, knocked, *last, 12, "after", 3));
  ASSERT_EQ(CountEvents(EventKind::kChangeDetected), 1);
  const auto change = store_->GetChange("a", 1);
  ASSERT_TRUE(change.ok()) << change.status();
  EXPECT_THAT(change->groups, ::testing::ElementsAre("extrinsics"));
  EXPECT_EQ(change->base_version, last->version);

  const auto after = store_->GetActiveCalibration("a");
  ASSERT_GT(after->version, last->version);
  EXPECT_THAT(after->reasons, ::testing::IsEmpty());
  for (const SegmentKey& key : after->segments) {
    EXPECT_EQ(key.session, "after") << key.index;
  }
  const Eigen::VectorXd error = BoxMinus(after->theta, knocked);
  const Eigen::VectorXd sigmas = after->covariance.diagonal().cwiseSqrt();
  const auto components = TangentComponents(knocked);
  for (const int i : FreeComponents(rig)) {
    EXPECT_LT(std::abs(error(i)), 3 * sigmas(i)) << components[i].name;
  }
  // What the knock does not concern stays as well known as it was.
  for (const char* group : {"imu", "camera"}) {
    for (const ParameterGroup& settings : rig.groups) {
      if (settings.name != group) continue;
      for (const int i : GroupComponents(rig, settings)) {
        EXPECT_LT(after->covariance(i, i), last->covariance(i, i))
            << components[i].name;
      }
    }
  }
  // The watcher knew of the knock before there was a new version, of which it
  // is told when this is stored.
  ASSERT_TRUE(Eventually([&] {
    const std::lock_guard lock(mutex);
    return told.size() >= 3;
  }));
  {
    const std::lock_guard lock(mutex);
    EXPECT_EQ(told[0].first, last->version);
    EXPECT_NE(told[0].second, VerdictKind::kNotTrustworthy);
    EXPECT_EQ(told[1], std::pair(last->version, VerdictKind::kNotTrustworthy));
    EXPECT_GT(told[2].first, last->version);
  }
  const auto runs = store_->ListRuns("a", {});
  ASSERT_TRUE(runs.ok());
  EXPECT_EQ(store_->GetRun("a", *after->run)->change, 1);
  const auto triggers = [&](RunTrigger trigger) {
    return std::count_if(
        runs->items.begin(), runs->items.end(), [&](const StoredRun& run) {
          return run.trigger == trigger;
        });
  };
  EXPECT_EQ(triggers(RunTrigger::kChangeDetected), 1);
}

}  // namespace
}  // namespace selfcal::server
