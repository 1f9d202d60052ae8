// A filter with all its habits streams to a daemon: tracks without positions,
// states at the exposure of images with a time offset, pixels outside the
// image, ids that start again after a restart, and a phase in which it
// diverges.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "client/selfcal/client.h"
#include "client/selfcal/segment_builder.h"
#include "test/client/selfcal/drain.h"
#include "test/client/selfcal/simulated_filter.h"
#include "test/system/running_daemon.h"

namespace selfcal::client {
namespace {

constexpr double kTimeOffset_s = 0.007;
constexpr double kSeconds = 60;
// The filter diverges from this keyframe on, notices it after some more, and
// starts again later.
constexpr std::size_t kDiverges = 250;
constexpr std::size_t kNoticed = 255;
constexpr std::size_t kRestarted = 290;

struct SimulatedDevice {
  Rig rig;
  std::vector<MotionSegment> segments;  // by a SLAM system without habits
  FilterSession session;
};

// A calibrated device; its filter estimates with the true calibration.
SimulatedDevice MakeDevice() {
  SimulatedDevice device;
  device.rig = HandheldRig("filter");
  device.rig.factory.cameras[0].time_offset_s = kTimeOffset_s;
  device.rig.min_gain_nats = 1e9;  // of no segment: no run takes the processor
  const Calibration& theta = device.rig.factory;
  SimulationOptions options;
  options.seed = 5;
  // A filter is accurate over the seconds of a segment.
  options.slam_rotation_rad = 1e-4;
  options.slam_position_m = 3e-4;
  options.slam_velocity_mps = 1e-3;
  options.slam_accel_bias_mps2 = 1e-3;
  options.slam_gyro_bias_radps = 1e-4;
  const auto trajectory = MakeHandheld(kSeconds, 0.7, 5);
  device.segments =
      Simulate(device.rig, theta, theta, *trajectory, "plain", options)
          .segments;
  device.session = MakeFilterSession(device.segments, theta, *trajectory);
  return device;
}

// Numbers the tracks from 1 on, again after Restart.
class TrackIds {
 public:
  void Restart() { ids_.clear(); }
  std::uint64_t Of(std::uint64_t landmark) {
    return ids_.emplace(landmark, ids_.size() + 1).first->second;
  }

 private:
  std::map<std::uint64_t, std::uint64_t> ids_;
};

// Adds the keyframes of the filter, each after the samples up to its state.
void Stream(const FilterSession& session,
            SegmentBuilder* builder,
            SegmentStream* stream) {
  TrackIds ids;
  auto sample = session.imu.begin();
  for (std::size_t k = 0; k < session.steps.size(); ++k) {
    FilterStep step = session.steps[k];
    for (; sample != session.imu.end() && sample->t_ns <= step.state.t_ns;
         ++sample) {
      builder->AddImu(*sample);
    }
    if (k == kNoticed) builder->SetHealthy(false);
    if (k == kRestarted) {
      builder->SetHealthy(true);
      ids.Restart();
    }
    if (k >= kDiverges && k < kRestarted) {
      step.state.p_GI *= 1.0 + static_cast<double>(k - kDiverges);
      step.state.v_GI *= 30;
    }
    for (KeyframeObservation& seen : step.seen) {
      seen.landmark_id = ids.Of(seen.landmark_id);
    }
    // A tracker follows a patch beyond the border.
    if (k % 8 == 0) {
      step.seen.front().z_px.x() = -6;
      step.seen.back().z_px.y() = 480 + 2.5;
    }
    builder->AddKeyframe(step.state, step.image_t_ns, step.seen);
    while (auto closed = builder->TakeClosed()) {
      ASSERT_TRUE(stream->Send(*std::move(closed)));
      ASSERT_TRUE(DrainFully(stream).ok());
    }
  }
}

double MeanRms_px(const std::vector<v1::Segment>& segments,
                  const std::string& session) {
  double sum = 0;
  int count = 0;
  for (const v1::Segment& segment : segments) {
    if (!LastPart(segment.name()).starts_with(session + "~")) continue;
    sum += segment.residuals().reprojection_rms_px();
    ++count;
  }
  return count > 0 ? sum / count : 0;
}

TEST(FilterStream, EveryGoodSegmentIsStoredWithResidualsAtTheStatedNoise) {
  const SimulatedDevice device = MakeDevice();
  ASSERT_GT(device.session.steps.size(), 500u);
  const ScratchFolder folder;
  const auto daemon = folder.StartDaemon();
  DaemonView view(folder.target(), "filter");
  ASSERT_TRUE(view.CreateRig(device.rig).ok());

  ClientOptions client;
  client.target = folder.target();
  client.rig = "filter";
  std::vector<std::string> violations;
  SegmentStream stream(client, [&](const Acknowledgement& ack) {
    for (const Violation& v : ack.violations) {
      violations.push_back(v.field + " " + v.message);
    }
  });
  SegmentBuilder builder({.session = "filter",
                          .theta = device.rig.factory,
                          .pixel_sigma_px = device.rig.pixel_sigma_px});
  Stream(device.session, &builder, &stream);
  ASSERT_TRUE(DrainFully(&stream).ok());
  EXPECT_TRUE(violations.empty()) << violations.front();

  // 240 keyframes before the divergence, 300 or so after the restart.
  const auto after = device.session.steps.size() - 1 - kRestarted;
  const std::uint64_t good = kDiverges / 40 + after / 40;
  const SegmentBuilderStatistics built = builder.statistics();
  const StreamStatistics sent = stream.statistics();
  EXPECT_EQ(built.segments, good);
  EXPECT_EQ(built.keyframes_unhealthy, kRestarted - 240);
  EXPECT_EQ(built.keyframes_dropped, 0u);
  EXPECT_GT(built.observations_dropped, 100u);
  EXPECT_EQ(sent.stored, good);
  EXPECT_EQ(sent.rejected, 0u);
  EXPECT_EQ(sent.observations_dropped, 0u) << "the builder has dropped them";
  EXPECT_GT(sent.tracks_triangulated, 4 * sent.tracks_dropped);

  // The same motion as landmarks with positions and states at the timestamps.
  for (const MotionSegment& segment : device.segments) {
    ASSERT_TRUE(stream.Send(segment));
    ASSERT_TRUE(DrainFully(&stream).ok());
  }
  const auto all = good + device.segments.size();
  ASSERT_TRUE(WaitUntilIdle(view, all, std::chrono::seconds(120)).ok());
  const auto state = view.GetState();
  ASSERT_TRUE(state.ok()) << state.status();
  for (const v1::Segment& segment : state->segments) {
    SCOPED_TRACE(segment.name());
    const v1::ResidualStatistics& residuals = segment.residuals();
    EXPECT_EQ(segment.state(), v1::Segment::SCORED);
    EXPECT_GT(residuals.fit(), 0.8);
    EXPECT_LT(residuals.fit(), 1.2);
    EXPECT_FALSE(residuals.many_outliers());
    EXPECT_GT(residuals.inliers(), 0.98 * residuals.observations());
  }
  const double plain_px = MeanRms_px(state->segments, "plain");
  const double filter_px = MeanRms_px(state->segments, "filter");
  RecordProperty("plain_rms_px", fmt::format("{:.3f}", plain_px));
  RecordProperty("filter_rms_px", fmt::format("{:.3f}", filter_px));
  EXPECT_NEAR(filter_px, plain_px, 0.05 * plain_px);
  // Two coordinates of 0.8 px each.
  EXPECT_LT(filter_px, 1.25 * device.rig.pixel_sigma_px * std::sqrt(2));
}

}  // namespace
}  // namespace selfcal::client
