// The layout of the structs of selfcal.h, with which programs are compiled: it
// never changes on 64-bit machines. A struct with struct_size may get members
// after those that stand here.
#include <gtest/gtest.h>

#include <cstddef>

#include "client/c/boundary.h"
#include "client/c/selfcal.h"

namespace selfcal::testing_c {
namespace {

#define EXPECT_MEMBER(type, member, offset, size) \
  EXPECT_EQ(offsetof(type, member), offset##u);   \
  EXPECT_EQ(sizeof(decltype(type::member)), size##u) << #type "." #member

TEST(Layout, OfStructsThatNeverChange) {
  EXPECT_MEMBER(selfcal_error, code, 0, 4);
  EXPECT_MEMBER(selfcal_error, message, 4, 508);
  EXPECT_EQ(sizeof(selfcal_error), 512u);

  EXPECT_MEMBER(selfcal_quaternion, w, 0, 8);
  EXPECT_MEMBER(selfcal_quaternion, x, 8, 8);
  EXPECT_MEMBER(selfcal_quaternion, y, 16, 8);
  EXPECT_MEMBER(selfcal_quaternion, z, 24, 8);
  EXPECT_EQ(sizeof(selfcal_quaternion), 32u);

  EXPECT_MEMBER(selfcal_imu_sample, t_ns, 0, 8);
  EXPECT_MEMBER(selfcal_imu_sample, gyro, 8, 24);
  EXPECT_MEMBER(selfcal_imu_sample, accel, 32, 24);
  EXPECT_EQ(sizeof(selfcal_imu_sample), 56u);

  EXPECT_MEMBER(selfcal_keyframe_state, t_ns, 0, 8);
  EXPECT_MEMBER(selfcal_keyframe_state, q_GI, 8, 32);
  EXPECT_MEMBER(selfcal_keyframe_state, p_GI, 40, 24);
  EXPECT_MEMBER(selfcal_keyframe_state, v_GI, 64, 24);
  EXPECT_MEMBER(selfcal_keyframe_state, b_a, 88, 24);
  EXPECT_MEMBER(selfcal_keyframe_state, b_g, 112, 24);
  EXPECT_EQ(sizeof(selfcal_keyframe_state), 136u);

  EXPECT_MEMBER(selfcal_observation, landmark_id, 0, 8);
  EXPECT_MEMBER(selfcal_observation, camera, 8, 4);
  EXPECT_MEMBER(selfcal_observation, reserved, 12, 4);
  EXPECT_MEMBER(selfcal_observation, z_px, 16, 16);
  EXPECT_MEMBER(selfcal_observation, p_G, 32, 24);
  EXPECT_EQ(sizeof(selfcal_observation), 56u);

  EXPECT_MEMBER(selfcal_violation, field, 0, 8);
  EXPECT_MEMBER(selfcal_violation, message, 8, 8);
  EXPECT_EQ(sizeof(selfcal_violation), 16u);
}

TEST(Layout, OfOptions) {
  EXPECT_MEMBER(selfcal_builder_options, struct_size, 0, 4);
  EXPECT_MEMBER(selfcal_builder_options, keyframes, 4, 4);
  EXPECT_MEMBER(selfcal_builder_options, min_observations, 8, 4);
  EXPECT_MEMBER(selfcal_builder_options, min_keyframes, 12, 4);
  EXPECT_MEMBER(selfcal_builder_options, session, 16, 8);
  EXPECT_MEMBER(selfcal_builder_options, first_index, 24, 8);
  EXPECT_MEMBER(selfcal_builder_options, calibration_version, 32, 8);
  EXPECT_MEMBER(selfcal_builder_options, seconds, 40, 8);
  EXPECT_MEMBER(selfcal_builder_options, max_gap_s, 48, 8);
  EXPECT_MEMBER(selfcal_builder_options, pixel_sigma_px, 56, 8);
  EXPECT_MEMBER(selfcal_builder_options, gravity_mps2, 64, 8);
  EXPECT_MEMBER(selfcal_builder_options, same_ids_after_gap, 72, 4);
  EXPECT_MEMBER(selfcal_builder_options, reserved, 76, 4);
  EXPECT_MEMBER(selfcal_builder_options, session_start_ns, 80, 8);
  EXPECT_EQ(c::kBuilderOptionsSize, 80u);

  EXPECT_MEMBER(selfcal_client_options, struct_size, 0, 4);
  EXPECT_MEMBER(selfcal_client_options, max_queue, 4, 4);
  EXPECT_MEMBER(selfcal_client_options, max_unacknowledged, 8, 4);
  EXPECT_MEMBER(selfcal_client_options, reserved, 12, 4);
  EXPECT_MEMBER(selfcal_client_options, target, 16, 8);
  EXPECT_MEMBER(selfcal_client_options, rig, 24, 8);
  EXPECT_MEMBER(selfcal_client_options, min_backoff_ms, 32, 8);
  EXPECT_MEMBER(selfcal_client_options, max_backoff_ms, 40, 8);
  EXPECT_MEMBER(selfcal_client_options, ca_file, 48, 8);
  EXPECT_MEMBER(selfcal_client_options, certificate_file, 56, 8);
  EXPECT_MEMBER(selfcal_client_options, key_file, 64, 8);
  EXPECT_MEMBER(selfcal_client_options, spool_dir, 72, 8);
  EXPECT_MEMBER(selfcal_client_options, max_spool_bytes, 80, 8);
  EXPECT_EQ(c::kClientOptionsSize, 88u);
}

TEST(Layout, OfStatisticsAndAcknowledgements) {
  EXPECT_MEMBER(selfcal_builder_statistics, struct_size, 0, 4);
  EXPECT_MEMBER(selfcal_builder_statistics, segments, 8, 8);
  EXPECT_MEMBER(selfcal_builder_statistics, keyframes_refused, 16, 8);
  EXPECT_MEMBER(selfcal_builder_statistics, keyframes_dropped, 24, 8);
  EXPECT_MEMBER(selfcal_builder_statistics, keyframes_unhealthy, 32, 8);
  EXPECT_MEMBER(selfcal_builder_statistics, imu_ignored, 40, 8);
  EXPECT_MEMBER(selfcal_builder_statistics, observations_dropped, 48, 8);
  EXPECT_MEMBER(selfcal_builder_statistics, out_of_memory, 56, 8);
  EXPECT_EQ(c::kBuilderStatisticsSize, 64u);

  EXPECT_MEMBER(selfcal_stream_statistics, struct_size, 0, 4);
  EXPECT_MEMBER(selfcal_stream_statistics, queued, 8, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, stored, 16, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, duplicates, 24, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, rejected, 32, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, dropped, 40, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, resent, 48, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, connections, 56, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, callback_failures, 64, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, tracks_triangulated, 72, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, tracks_dropped, 80, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, observations_dropped, 88, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, spooled, 96, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, spool_recovered, 104, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, spool_damaged, 112, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, spool_failures, 120, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, spool_segments, 128, 8);
  EXPECT_MEMBER(selfcal_stream_statistics, spool_bytes, 136, 8);
  EXPECT_EQ(c::kStreamStatisticsSize, 144u);
  EXPECT_MEMBER(selfcal_stream_statistics, readings_dropped, 144, 8);

  EXPECT_MEMBER(selfcal_acknowledgement, struct_size, 0, 4);
  EXPECT_MEMBER(selfcal_acknowledgement, verdict, 4, 4);
  EXPECT_MEMBER(selfcal_acknowledgement, session, 8, 8);
  EXPECT_MEMBER(selfcal_acknowledgement, index, 16, 8);
  EXPECT_MEMBER(selfcal_acknowledgement, violations, 24, 8);
  EXPECT_MEMBER(selfcal_acknowledgement, violation_count, 32, 8);
  EXPECT_MEMBER(selfcal_acknowledgement, observations_dropped, 40, 8);
  EXPECT_MEMBER(selfcal_acknowledgement, readings_dropped, 48, 8);
}

TEST(Layout, OfTheCalibration) {
  EXPECT_MEMBER(selfcal_imu, struct_size, 0, 4);
  EXPECT_MEMBER(selfcal_imu, gyro_scale, 8, 24);
  EXPECT_MEMBER(selfcal_imu, gyro_misalignment, 32, 24);
  EXPECT_MEMBER(selfcal_imu, accel_scale, 56, 24);
  EXPECT_MEMBER(selfcal_imu, accel_misalignment, 80, 24);
  EXPECT_MEMBER(selfcal_imu, q_AI, 104, 32);
  EXPECT_MEMBER(selfcal_imu, gyro_g_sensitivity_size, 136, 4);
  EXPECT_MEMBER(selfcal_imu, accel_position_size, 140, 4);
  EXPECT_MEMBER(selfcal_imu, gyro_g_sensitivity, 144, 72);
  EXPECT_MEMBER(selfcal_imu, accel_position, 216, 72);
  EXPECT_EQ(c::kImuSize, 136u);

  EXPECT_MEMBER(selfcal_camera, struct_size, 0, 4);
  EXPECT_MEMBER(selfcal_camera, width_px, 4, 4);
  EXPECT_MEMBER(selfcal_camera, height_px, 8, 4);
  EXPECT_MEMBER(selfcal_camera, distortion_size, 12, 4);
  EXPECT_MEMBER(selfcal_camera, model, 16, 8);
  EXPECT_MEMBER(selfcal_camera, distortion, 24, 64);
  EXPECT_MEMBER(selfcal_camera, f, 88, 16);
  EXPECT_MEMBER(selfcal_camera, c, 104, 16);
  EXPECT_MEMBER(selfcal_camera, q_CI, 120, 32);
  EXPECT_MEMBER(selfcal_camera, p_CI, 152, 24);
  EXPECT_MEMBER(selfcal_camera, time_offset_s, 176, 8);
  EXPECT_MEMBER(selfcal_camera, rolling_shutter, 184, 4);
  EXPECT_MEMBER(selfcal_camera, line_delay_s, 192, 8);
  EXPECT_MEMBER(selfcal_camera, clock_drifts, 200, 4);
  EXPECT_MEMBER(selfcal_camera, time_drift, 208, 8);
  EXPECT_EQ(c::kCameraSize, 184u);

  EXPECT_MEMBER(selfcal_component, struct_size, 0, 4);
  EXPECT_MEMBER(selfcal_component, name, 8, 8);
  EXPECT_MEMBER(selfcal_component, unit, 16, 8);
  EXPECT_MEMBER(selfcal_component, value, 24, 8);
  EXPECT_MEMBER(selfcal_component, sigma, 32, 8);
  EXPECT_EQ(c::kComponentSize, 40u);
}

#undef EXPECT_MEMBER

// A program compares with these numbers, too.
TEST(Layout, NumbersOfTheEnumerations) {
  EXPECT_EQ(SELFCAL_OK, 0);
  EXPECT_EQ(SELFCAL_INVALID_ARGUMENT, 3);
  EXPECT_EQ(SELFCAL_DEADLINE_EXCEEDED, 4);
  EXPECT_EQ(SELFCAL_NOT_FOUND, 5);
  EXPECT_EQ(SELFCAL_PERMISSION_DENIED, 7);
  EXPECT_EQ(SELFCAL_RESOURCE_EXHAUSTED, 8);
  EXPECT_EQ(SELFCAL_FAILED_PRECONDITION, 9);
  EXPECT_EQ(SELFCAL_OUT_OF_RANGE, 11);
  EXPECT_EQ(SELFCAL_INTERNAL, 13);
  EXPECT_EQ(SELFCAL_UNAVAILABLE, 14);
  EXPECT_EQ(SELFCAL_DATA_LOSS, 15);
  EXPECT_EQ(SELFCAL_UNAUTHENTICATED, 16);
  EXPECT_EQ(SELFCAL_STORED, 0);
  EXPECT_EQ(SELFCAL_DUPLICATE, 1);
  EXPECT_EQ(SELFCAL_REJECTED, 2);
  EXPECT_EQ(SELFCAL_MAX_DISTORTION, 8);
}

}  // namespace
}  // namespace selfcal::testing_c
