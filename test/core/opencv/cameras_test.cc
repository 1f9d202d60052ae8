// The pixels of the camera models against those of OpenCV.
#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/ccalib/omnidir.hpp>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/camera.h"
#include "core/model/camera_model.h"
#include "test/core/model/random_values.h"

namespace selfcal {
namespace {

constexpr int kTrials = 1000;
constexpr int kPoints = 20;

// Predicts the pixels of points in the camera's frame.
using Projection = void (*)(const std::vector<cv::Point3d>& points_C,
                            const cv::Matx33d& K,
                            const std::vector<double>& distortion,
                            std::vector<cv::Point2d>* z_px);

const cv::Vec3d kNone(0, 0, 0);

void Pinhole(const std::vector<cv::Point3d>& points_C,
             const cv::Matx33d& K,
             const std::vector<double>& distortion,
             std::vector<cv::Point2d>* z_px) {
  cv::projectPoints(points_C, kNone, kNone, K, distortion, *z_px);
}

void FishEye(const std::vector<cv::Point3d>& points_C,
             const cv::Matx33d& K,
             const std::vector<double>& distortion,
             std::vector<cv::Point2d>* z_px) {
  cv::fisheye::projectPoints(points_C, *z_px, kNone, kNone, K, distortion);
}

void Omnidirectional(const std::vector<cv::Point3d>& points_C,
                     const cv::Matx33d& K,
                     const std::vector<double>& distortion,
                     std::vector<cv::Point2d>* z_px) {
  const std::vector<double> rest(distortion.begin() + 1, distortion.end());
  cv::omnidir::projectPoints(
      points_C, *z_px, kNone, kNone, K, distortion.front(), rest);
}

void ExpectSamePixels(std::string_view name,
                      Projection projection,
                      bool beyond_90_degrees) {
  RandomValues random(1);
  int behind = 0;
  int checked = 0;
  for (const DistortionModel model : DistortionModels()) {
    if (DistortionName(model) != name) continue;
    for (int i = 0; i < kTrials; ++i) {
      const CameraCalibration camera = random.Camera(model);
      std::vector<cv::Point3d> points_C;
      std::vector<Eigen::Vector2d> expected;
      for (int j = 0; j < kPoints; ++j) {
        const Eigen::Vector3d p_C = 3 * random.Direction();
        Eigen::Vector2d z_px;
        if (!beyond_90_degrees && p_C.z() < 0.1) continue;
        if (!Project(camera, p_C, &z_px, nullptr)) continue;
        points_C.emplace_back(p_C.x(), p_C.y(), p_C.z());
        expected.push_back(z_px);
      }
      if (points_C.empty()) continue;
      const cv::Matx33d K(camera.f.x(),
                          0,
                          camera.c.x(),
                          0,
                          camera.f.y(),
                          camera.c.y(),
                          0,
                          0,
                          1);
      std::vector<cv::Point2d> z_px;
      projection(points_C,
                 K,
                 {camera.distortion.begin(), camera.distortion.end()},
                 &z_px);
      ASSERT_EQ(z_px.size(), expected.size());
      for (std::size_t j = 0; j < z_px.size(); ++j) {
        const Eigen::Vector2d theirs(z_px[j].x, z_px[j].y);
        EXPECT_LT((expected[j] - theirs).norm(), 1e-9 * (1 + theirs.norm()))
            << camera.distortion.transpose();
        ++checked;
        behind += points_C[j].z < 0;
      }
    }
  }
  EXPECT_GT(checked, kTrials);
  EXPECT_EQ(behind > 0, beyond_90_degrees);
}

TEST(OpenCv, HasTheRadialTangentialModels) {
  ExpectSamePixels("radial-tangential", Pinhole, false);
  ExpectSamePixels("radial-tangential-5", Pinhole, false);
  ExpectSamePixels("radial-tangential-8", Pinhole, false);
}

// It divides by Z.
TEST(OpenCv, HasTheEquidistantModelUpTo90Degrees) {
  ExpectSamePixels("equidistant", FishEye, false);
}

TEST(OpenCv, HasTheUnifiedModel) {
  ExpectSamePixels("unified", Omnidirectional, true);
}

}  // namespace
}  // namespace selfcal
