#include "client/demo/stream_device.h"

#include <gmock/gmock.h>

#include <memory>
#include <numbers>
#include <string>

#include "client/demo/daemon_view.h"
#include "client/process/daemon_process.h"
#include "proto/convert.h"
#include "test/support/temp_folder.h"

namespace selfcal::client {
namespace {

constexpr double kDeg = std::numbers::pi / 180;
// Eight segments, as many as a table has room for: one run, at the last.
constexpr double kFullTables_s = 33;

class StreamDeviceTest : public testing::Test {
 protected:
  StreamDeviceTest() {
    auto daemon = DaemonProcess::Start(SELFCAL_DAEMON, folder_.File("state"));
    EXPECT_TRUE(daemon.ok()) << daemon.status();
    if (daemon.ok()) daemon_ = *std::move(daemon);
  }

  absl::Status Stream(const SimulatedUse& use) {
    Report report;
    return StreamDevice({daemon_->target(), "tablet", use}, &report);
  }

  // Of the active version from `truth`: the angle of its camera, and the share
  // of its focal length.
  void ExpectActive(std::int64_t version, const Calibration& truth) {
    DaemonView view(daemon_->target(), "tablet");
    const auto active = view.GetActive();
    ASSERT_TRUE(active.ok()) << active.status();
    EXPECT_EQ(active->version(), version);
    Calibration theta;
    ASSERT_TRUE(FromProto(active->parameters(), "", &theta).empty());
    const CameraCalibration& camera = theta.cameras[0];
    EXPECT_LT(camera.q_CI.angularDistance(truth.cameras[0].q_CI), 0.1 * kDeg);
    EXPECT_NEAR(camera.f.x() / truth.cameras[0].f.x(), 1, 0.003);
  }

  const TempFolder folder_;
  std::unique_ptr<DaemonProcess> daemon_;
};

TEST_F(StreamDeviceTest, CalibratesADeviceAndAgainOnceItIsKnocked) {
  ASSERT_NE(daemon_, nullptr);
  SimulatedUse use{.seed = 2, .session = 1, .seconds = kFullTables_s};
  ASSERT_EQ(Stream(use), absl::OkStatus());
  const Calibration truth = *SimulatedDevice("tablet", use.seed).truth;
  ExpectActive(2, truth);

  use.session = 2;
  use.seconds = 45;
  use.change.turn_rad = 1 * kDeg;
  ASSERT_EQ(Stream(use), absl::OkStatus());
  ExpectActive(3, ChangeCamera(truth, use.change));
  DaemonView view(daemon_->target(), "tablet");
  const auto runs = view.GetRuns();
  ASSERT_TRUE(runs.ok()) << runs.status();
  EXPECT_EQ(runs->front().trigger(), v1::Recalibration::CHANGE_DETECTED);
  const auto state = view.GetState();
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_THAT(state->segments.back().name(), testing::HasSubstr("session-2~"));
  EXPECT_EQ(state->segments.back().calibration_version(), 2);
}

TEST_F(StreamDeviceTest, StreamsTheSessionOnce) {
  ASSERT_NE(daemon_, nullptr);
  const SimulatedUse use{.seed = 5, .session = 1, .seconds = 9};
  ASSERT_EQ(Stream(use), absl::OkStatus());
  ASSERT_EQ(Stream(use), absl::OkStatus());
  DaemonView view(daemon_->target(), "tablet");
  const auto state = view.GetState();
  ASSERT_TRUE(state.ok()) << state.status();
  EXPECT_EQ(state->segments.size(), 2u);
}

TEST_F(StreamDeviceTest, RefusesARigWithOtherCameras) {
  ASSERT_NE(daemon_, nullptr);
  Rig rig = HandheldRig("tablet");
  rig.factory.cameras.push_back(rig.factory.cameras[0]);
  ASSERT_EQ(DaemonView(daemon_->target(), "tablet").CreateRig(rig),
            absl::OkStatus());
  const absl::Status status = Stream({});
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("cameras"));
}

TEST_F(StreamDeviceTest, NamesADaemonThatDoesNotAnswer) {
  Report report;
  const absl::Status status = StreamDevice(
      {"unix:" + folder_.File("nothing.sock"), "tablet", {}}, &report);
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
}

TEST(SimulateUseTest, SessionsDifferAndAreTheSameEachTime) {
  const Device device = SimulatedDevice("tablet", 3);
  const auto simulate = [&](int session) {
    return SimulateUse(device,
                       {.seed = 3, .session = session, .seconds = 5},
                       device.rig.factory,
                       7)
        .value()
        .front();
  };
  const MotionSegment first = simulate(1);
  EXPECT_EQ(first.key.session, "session-1");
  EXPECT_EQ(first.calibration_version, 7);
  const MotionSegment same = simulate(1);
  const MotionSegment other = simulate(2);
  EXPECT_EQ(first.imu.back().gyro, same.imu.back().gyro);
  EXPECT_NE(first.imu.back().gyro, other.imu.back().gyro);
}

}  // namespace
}  // namespace selfcal::client
