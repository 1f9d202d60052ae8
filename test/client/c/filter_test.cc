// What the builder takes from a filter, through the C interface: the segments
// are those of the C++ builder.
#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <vector>

#include "client/c/segment.h"
#include "client/c/selfcal.h"
#include "client/selfcal/encoded_segment.h"
#include "client/selfcal/segment_builder.h"
#include "test/client/c/session.h"

namespace selfcal::testing_c {
namespace {

constexpr std::int64_t kExposureNs = 3'000'000;  // after the timestamp

Calibration FilterTheta() {
  Calibration theta;
  theta.imu.s_g = {1.01, 1.02, 1.03};
  theta.cameras.resize(2);
  for (CameraCalibration& camera : theta.cameras) {
    camera.f = {400, 410};
    camera.c = {0, 0};
    camera.distortion << 0.9;
    camera.width_px = 640;
    camera.height_px = 480;
  }
  return theta;
}

// Owns what FilterTheta() is in the C interface.
std::unique_ptr<selfcal_calibration, decltype(&selfcal_calibration_destroy)>
MakeCalibration() {
  const Calibration theta = FilterTheta();
  selfcal_imu imu = {};
  imu.struct_size = sizeof(imu);
  selfcal_camera camera = {};
  camera.struct_size = sizeof(camera);
  for (int i = 0; i < 3; ++i) imu.gyro_scale[i] = theta.imu.s_g[i];
  for (double& scale : imu.accel_scale) scale = 1;
  imu.q_AI.w = 1;
  camera.q_CI.w = 1;
  camera.model = "fov";
  camera.distortion_size = 1;
  camera.distortion[0] = 0.9;
  camera.f[0] = 400;
  camera.f[1] = 410;
  camera.width_px = 640;
  camera.height_px = 480;
  const selfcal_camera* const cameras[2] = {&camera, &camera};
  selfcal_calibration* made = nullptr;
  EXPECT_EQ(selfcal_calibration_create(&imu, cameras, 2, &made, nullptr), 0);
  return {made, &selfcal_calibration_destroy};
}

// As a filter gives it: tracks without positions, and states at the exposure.
Session FilterSession() {
  Session session = MakeSession(60);
  const double none = std::numeric_limits<double>::quiet_NaN();
  for (Keyframe& keyframe : session.keyframes) {
    keyframe.state.t_ns += kExposureNs;
    for (selfcal_observation& seen : keyframe.observations) {
      for (double& coordinate : seen.p_G) coordinate = none;
      for (double& pixel : seen.z_px) pixel = 100 * (1 + pixel);
    }
    keyframe.observations[0].z_px[0] = -50;  // outside the image
  }
  return session;
}

// What happens before keyframe k.
enum class Event { kNone, kVersion, kUnhealthy, kHealthy };
Event EventAt(std::size_t k) {
  if (k == 15) return Event::kVersion;
  if (k == 30) return Event::kUnhealthy;
  if (k == 34) return Event::kHealthy;
  return Event::kNone;
}

// The bytes of the messages that carry the segments.
using Messages = std::vector<std::string>;

void Append(client::ClosedSegment closed, Messages* messages) {
  const auto encoded = client::Encode("device", std::move(closed));
  const auto* segment = std::get_if<client::EncodedSegment>(&encoded);
  ASSERT_NE(segment, nullptr);
  messages->push_back(segment->request->SerializeAsString());
}

Messages InCxx20(const Session& session) {
  client::SegmentBuilder builder({.session = "walk",
                                  .keyframes = 12,
                                  .min_keyframes = 4,
                                  .pixel_sigma_px = 0.5,
                                  .gravity_mps2 = 9.8});
  Messages messages;
  EXPECT_TRUE(builder.SetTheta(FilterTheta()));
  for (const selfcal_imu_sample& s : session.imu) {
    builder.AddImu({s.t_ns, Eigen::Vector3d(s.gyro), Eigen::Vector3d(s.accel)});
  }
  for (std::size_t k = 0; k < session.keyframes.size(); ++k) {
    if (EventAt(k) == Event::kVersion) builder.SetCalibrationVersion(2);
    if (EventAt(k) == Event::kUnhealthy) builder.SetHealthy(false);
    if (EventAt(k) == Event::kHealthy) builder.SetHealthy(true);
    const selfcal_keyframe_state& x = session.keyframes[k].state;
    KeyframeState state;
    state.t_ns = x.t_ns;
    state.q_GI = Eigen::Quaterniond(x.q_GI.w, x.q_GI.x, x.q_GI.y, x.q_GI.z);
    state.p_GI = Eigen::Vector3d(x.p_GI);
    state.v_GI = Eigen::Vector3d(x.v_GI);
    state.b_a = Eigen::Vector3d(x.b_a);
    state.b_g = Eigen::Vector3d(x.b_g);
    std::vector<client::KeyframeObservation> observations;
    for (const selfcal_observation& seen : session.keyframes[k].observations) {
      observations.push_back({seen.camera,
                              seen.landmark_id,
                              Eigen::Vector2d(seen.z_px),
                              Eigen::Vector3d(seen.p_G)});
    }
    builder.AddKeyframe(state, x.t_ns - kExposureNs, observations);
  }
  builder.Flush(2);
  while (auto closed = builder.TakeClosed()) {
    Append(*std::move(closed), &messages);
  }
  return messages;
}

Messages InC(const Session& session, selfcal_builder_statistics* statistics) {
  selfcal_builder_options walk = {};
  walk.struct_size = sizeof(walk);
  walk.session = "walk";
  walk.keyframes = 12;
  walk.min_keyframes = 4;
  walk.pixel_sigma_px = 0.5;
  walk.gravity_mps2 = 9.8;
  Messages messages;
  selfcal_builder* builder = nullptr;
  EXPECT_EQ(selfcal_builder_create(&walk, &builder, nullptr), SELFCAL_OK);
  EXPECT_EQ(
      selfcal_builder_set_theta(builder, MakeCalibration().get(), nullptr),
      SELFCAL_OK);
  for (const selfcal_imu_sample& sample : session.imu) {
    selfcal_builder_add_imu(builder, &sample, nullptr);
  }
  for (std::size_t k = 0; k < session.keyframes.size(); ++k) {
    if (EventAt(k) == Event::kVersion) {
      selfcal_builder_set_calibration_version(builder, 2, nullptr);
    }
    if (EventAt(k) == Event::kUnhealthy) {
      selfcal_builder_set_healthy(builder, 0, nullptr);
    }
    if (EventAt(k) == Event::kHealthy) {
      selfcal_builder_set_healthy(builder, 1, nullptr);
    }
    const Keyframe& keyframe = session.keyframes[k];
    const bool healthy = k < 30 || k >= 34;
    EXPECT_EQ(selfcal_builder_add_keyframe_at(builder,
                                              &keyframe.state,
                                              keyframe.state.t_ns - kExposureNs,
                                              keyframe.observations.data(),
                                              keyframe.observations.size(),
                                              nullptr),
              healthy ? SELFCAL_OK : SELFCAL_OUT_OF_RANGE);
  }
  selfcal_builder_flush(builder, 2, nullptr);
  while (selfcal_segment* segment = selfcal_builder_take(builder)) {
    Append(segment->closed, &messages);
    selfcal_segment_destroy(segment);
  }
  statistics->struct_size = sizeof(*statistics);
  selfcal_builder_get_statistics(builder, statistics, nullptr);
  selfcal_builder_destroy(builder);
  return messages;
}

TEST(Filter, GivesTheSameSegmentsInC) {
  const Session session = FilterSession();
  const Messages expected = InCxx20(session);
  EXPECT_GE(expected.size(), 4u);
  selfcal_builder_statistics statistics = {};
  EXPECT_EQ(InC(session, &statistics), expected);
  EXPECT_GE(statistics.keyframes_unhealthy, 4u);
  EXPECT_GT(statistics.observations_dropped, 0u);
}

}  // namespace
}  // namespace selfcal::testing_c
