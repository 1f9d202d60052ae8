// A start from rendered images, without the gyroscope's predictions, which
// need a rotation and a time offset that nobody knows yet.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "client/tracking/feature_tracker.h"
#include "core/initialisation/rotation_start.h"
#include "core/model/camera_model.h"
#include "core/model/so3.h"
#include "test/rendering/rendered_recording.h"

namespace selfcal {
namespace {

std::vector<TrackedImage> Track(const RenderedRecording& recording,
                                const CameraCalibration& guess) {
  Calibration theta;
  theta.cameras = {guess};
  client::FeatureTracker tracker(theta, {});
  std::vector<TrackedImage> images;
  for (int k = 0; k < recording.images(); ++k) {
    GreyImage rendered = recording.Image(0, k);
    const cv::Mat mat(
        rendered.height_px, rendered.width_px, CV_8UC1, rendered.pixels.data());
    TrackedImage image{recording.stamp_ns(k), {}};
    for (const client::TrackPoint& point : tracker.Track(image.t_ns, {mat})) {
      image.points.push_back({point.landmark, point.z_px});
    }
    images.push_back(std::move(image));
  }
  return images;
}

TEST(RotationStartOfTracks, NeedsOnlyImagesReadingsAndAGuessOfTheLens) {
  Rig rig = HandheldRig("start");
  CameraCalibration& camera = rig.factory.cameras[0];
  camera.time_offset_s = 0.03;
  camera.line_delay_s = 3e-5;
  RenderOptions options;
  options.exposure_s = 5e-3;
  const RenderedRecording recording(rig, MakeHandheld(8, 1, 2), options);

  CameraCalibration guess = camera;
  guess.q_CI.setIdentity();
  guess.p_CI.setZero();
  guess.time_offset_s = 0;
  guess.model = DistortionModel::kEquidistant;
  guess.distortion = Undistorted(guess.model);
  guess.f.setConstant(0.8 * guess.width_px);
  guess.c = {320, 240};
  const RotationStartResult result =
      FindRotationStart(guess,
                        rig.factory.imu,
                        Track(recording, guess),
                        recording.imu().measured,
                        {.estimate_focal_scale = true});
  ASSERT_TRUE(result.start) << result.reason;
  const RotationStart& start = *result.start;
  const double rotation = Log(camera.q_CI.conjugate() * start.q_CI).norm();
  const double offset_s = start.time_offset_s - camera.time_offset_s;
  const double focal = start.focal_scale * PixelsPerRadian(guess).x() /
                       PixelsPerRadian(camera).x();
  std::printf(
      "q_CI %.2f mrad, time offset %.3f ms, focal length %.2f %%, "
      "residual %.2f px\n",
      1e3 * rotation,
      1e3 * offset_s,
      100 * (focal - 1),
      start.residual_px);
  // The principal point of the guess is off by 2 px, 7 mrad.
  EXPECT_LT(rotation, 0.012);
  EXPECT_LT(std::abs(offset_s), 5e-4);
  // The scale of this lens, which is not quite equidistant, grows by 1.4 % from
  // the axis to 1 rad beside it.
  EXPECT_NEAR(focal, 1, 0.02);
  EXPECT_LT(start.residual_px, 0.3);
}

}  // namespace
}  // namespace selfcal
