#include "test/rendering/camera_renderer.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/model/camera_model.h"
#include "core/model/so3.h"
#include "test/core/simulation/rigs.h"

namespace selfcal {
namespace {

constexpr double kSquare_m = 0.25;

// A body that turns about the axis of w_I and moves along a line.
class SteadyMotion : public Trajectory {
 public:
  SteadyMotion(const Eigen::Vector3d& w_I, const Eigen::Vector3d& v_G)
      : w_I_(w_I), v_G_(v_G) {}
  double duration_s() const override { return 100; }
  BodyMotion At(double t_s) const override {
    BodyMotion motion;
    motion.q_GI = Exp(w_I_ * (t_s - 1));
    motion.p_GI = v_G_ * (t_s - 1);
    motion.v_GI = v_G_;
    motion.a_GI.setZero();
    motion.w_I = w_I_;
    return motion;
  }

 private:
  Eigen::Vector3d w_I_;
  Eigen::Vector3d v_G_;
};

// A room about the origin, all of it a chessboard with a corner in the middle
// of each wall.
Scene ChessRoom() {
  Scene scene{MakeCheckerTexture(10, kSquare_m / 64, 64, 40, 215), {}, {}, {}};
  scene.room.half_m = {2, 2, 2};
  scene.offsets = {Eigen::Vector2d::Zero()};
  return scene;
}

// Camera whose axis is the body's x axis, as that of the hand-held device, but
// exactly.
CameraCalibration ForwardCamera(CameraCalibration camera) {
  Eigen::Matrix3d R_CI;
  R_CI << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  camera.q_CI = R_CI;
  camera.p_CI.setZero();
  return camera;
}

cv::Mat AsImage(const CameraCalibration& camera,
                const std::vector<float>& radiance) {
  const cv::Mat values(camera.height_px,
                       camera.width_px,
                       CV_32FC1,
                       const_cast<float*>(radiance.data()));
  return values.clone();
}

cv::Mat Rendered(const CameraCalibration& camera,
                 const Scene& scene,
                 const Trajectory& motion,
                 double t_s,
                 double exposure_s) {
  std::vector<float> radiance;
  CameraRenderer(camera).Render(scene, motion, t_s, exposure_s, &radiance);
  return AsImage(camera, radiance);
}

// OpenCV's corners have a bias of some hundredths of a pixel where edges are
// sharper than its gradients.
cv::Mat Smoothed(const cv::Mat& image) {
  cv::Mat smooth;
  cv::GaussianBlur(image, smooth, {0, 0}, 1.2);
  return smooth;
}

// The corner of squares nearest to a pixel, as OpenCV measures it.
Eigen::Vector2d CornerNear(const cv::Mat& smooth, const Eigen::Vector2d& z_px) {
  std::vector<cv::Point2f> corner = {
      cv::Point2f(static_cast<float>(z_px.x()), static_cast<float>(z_px.y()))};
  cv::cornerSubPix(
      smooth,
      corner,
      {4, 4},
      {-1, -1},
      {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-4});
  return {corner[0].x, corner[0].y};
}

// Corners of the squares on the wall ahead, in G.
std::vector<Eigen::Vector3d> CornersAhead(int reach) {
  std::vector<Eigen::Vector3d> corners;
  for (int i = -reach; i <= reach; ++i) {
    for (int j = -reach; j <= reach; ++j) {
      corners.emplace_back(2, kSquare_m * i, kSquare_m * j);
    }
  }
  return corners;
}

bool IsWellInside(const CameraCalibration& camera, const Eigen::Vector2d& z) {
  return z.x() > 12 && z.y() > 12 && z.x() < camera.width_px - 13 &&
         z.y() < camera.height_px - 13;
}

bool ProjectFrom(const CameraCalibration& camera,
                 const BodyMotion& motion,
                 const Eigen::Vector3d& p_G,
                 Eigen::Vector2d* z_px) {
  const Eigen::Vector3d p_I = motion.q_GI.conjugate() * (p_G - motion.p_GI);
  return Project(camera, camera.q_CI * p_I + camera.p_CI, z_px, nullptr);
}

class EveryModel : public testing::TestWithParam<DistortionModel> {};

TEST_P(EveryModel, CornersAppearWhereTheModelProjectsThem) {
  const CameraCalibration camera =
      ForwardCamera(LensRig(GetParam()).factory.cameras[0]);
  const SteadyMotion motion({0.2, -0.1, 0.15}, {-0.1, 0.2, 0.15});
  const cv::Mat image =
      Smoothed(Rendered(camera, ChessRoom(), motion, 1.7, {}));
  double squares = 0;
  double largest = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  int corners = 0;
  for (const Eigen::Vector3d& p_G : CornersAhead(4)) {
    Eigen::Vector2d expected;
    if (!ProjectFrom(camera, motion.At(1.7), p_G, &expected)) continue;
    if (!IsWellInside(camera, expected)) continue;
    const Eigen::Vector2d error = CornerNear(image, expected) - expected;
    mean += error;
    squares += error.squaredNorm();
    largest = std::max(largest, error.norm());
    ++corners;
  }
  ASSERT_GT(corners, 40);
  // Lines bend within the window of the corner finder, one way or the other:
  // 0.02 to 0.03 px, and nothing on average.
  EXPECT_LT(std::sqrt(squares / corners), 0.04);
  EXPECT_LT(largest, 0.1);
  EXPECT_LT((mean / corners).norm(), 0.01);
}

INSTANTIATE_TEST_SUITE_P(Models,
                         EveryModel,
                         testing::ValuesIn(DistortionModels().begin(),
                                           DistortionModels().end()));

TEST(CameraRenderer, RowsOfARollingShutterAreSeenWhenTheyAreExposed) {
  CameraCalibration camera =
      ForwardCamera(LensRig(DistortionModel::kFov).factory.cameras[0]);
  camera.line_delay_s = 40e-6;
  const SteadyMotion motion({0.3, 0.4, 1.5}, {0.1, 0.5, 0});
  const Scene scene = ChessRoom();
  const cv::Mat image = Smoothed(Rendered(camera, scene, motion, 1, 0));
  int corners = 0;
  double moved = 0;
  for (const Eigen::Vector3d& p_G : CornersAhead(3)) {
    // The row decides the time, and the time the row: the motion is slow
    // against the rows, so that this converges.
    double row = 320;
    Eigen::Vector2d z_px;
    bool seen = true;
    for (int i = 0; i < 20 && seen; ++i) {
      const BodyMotion at_row = motion.At(1 + row * *camera.line_delay_s);
      seen = ProjectFrom(camera, at_row, p_G, &z_px);
      row = z_px.y();
    }
    Eigen::Vector2d at_once;
    if (!seen || !ProjectFrom(camera, motion.At(1), p_G, &at_once)) continue;
    if (!IsWellInside(camera, z_px)) continue;
    EXPECT_LT((CornerNear(image, z_px) - z_px).norm(), 0.08);
    moved = std::max(moved, (z_px - at_once).norm());
    ++corners;
  }
  EXPECT_GT(corners, 25);
  EXPECT_GT(moved, 5);
}

// Standard deviation of the derivative of an edge along a row, about its
// middle.
double EdgeWidth(const cv::Mat& image, int row, int first, int last) {
  double sum = 0;
  double mean = 0;
  double squares = 0;
  for (int u = first; u < last; ++u) {
    const double step =
        std::abs(image.at<float>(row, u + 1) - image.at<float>(row, u));
    sum += step;
    mean += step * u;
    squares += step * u * u;
  }
  mean /= sum;
  return std::sqrt(squares / sum - mean * mean);
}

TEST(CameraRenderer, EdgesAreBlurredByTheMotionDuringTheExposure) {
  const CameraCalibration camera = ForwardCamera(
      LensRig(DistortionModel::kRadialTangential).factory.cameras[0]);
  const Scene scene = ChessRoom();
  const double radps = 2;
  const SteadyMotion motion({0, 0, radps}, Eigen::Vector3d::Zero());
  // The edge in the middle of the wall, between two rows of squares.
  Eigen::Vector2d z_px;
  ASSERT_TRUE(Project(
      camera, camera.q_CI * Eigen::Vector3d(2, 0, 0.125), &z_px, nullptr));
  const int row = static_cast<int>(std::lround(z_px.y()));
  const int middle = static_cast<int>(std::lround(z_px.x()));
  const auto width = [&](double exposure_s) {
    const cv::Mat image = Rendered(camera, scene, motion, 1, exposure_s);
    return EdgeWidth(image, row, middle - 22, middle + 22);
  };
  const double sharp = width(0);
  EXPECT_LT(sharp, 0.75);
  for (const double exposure_s : {0.008, 0.016, 0.03}) {
    const double blur_px = camera.f.x() * radps * exposure_s;
    const double added =
        std::sqrt(std::pow(width(exposure_s), 2) - sharp * sharp);
    // A uniform distribution of this length.
    EXPECT_NEAR(added * std::sqrt(12), blur_px, 0.03 * blur_px + 0.1);
  }
}

// The opposite motion exposes the same poses in the opposite order.
TEST(CameraRenderer, ExposureDoesNotDependOnTheDirectionOfTime) {
  const CameraCalibration camera = ForwardCamera(
      LensRig(DistortionModel::kRadialTangential).factory.cameras[0]);
  Scene scene{MakeLeafTexture(3), {}, {}, {}};
  scene.room.half_m = {2, 2, 2};
  scene.offsets = {Eigen::Vector2d::Zero()};
  const double radps = 2, exposure_s = 0.003;
  const auto image = [&](double sign) {
    const SteadyMotion motion({0, 0, sign * radps}, Eigen::Vector3d::Zero());
    return Rendered(camera, scene, motion, 1, exposure_s);
  };
  const cv::Mat one = image(1), other = image(-1);
  // The shift between both, by least squares.
  double product = 0, square = 0;
  for (int v = 20; v < one.rows - 20; ++v) {
    for (int u = 20; u < one.cols - 20; ++u) {
      const double gradient =
          (one.at<float>(v, u + 1) - one.at<float>(v, u - 1)) / 2;
      product += gradient * (one.at<float>(v, u) - other.at<float>(v, u));
      square += gradient * gradient;
    }
  }
  const double blur_px = camera.f.x() * radps * exposure_s;
  EXPECT_LT(std::abs(product / square), 2e-3 * blur_px);
}

TEST(CameraRenderer, SurfacesAreThoseThatRaysMeet) {
  // A texture without contrast: pixels show the brightness of the face.
  const auto trajectory = MakeHandheld(10, 1, 4);
  SceneOptions options;
  options.boxes = 20;
  options.moving_boxes = 4;
  Scene scene = MakeRoom(*trajectory, options, 4);
  scene.texture = Texture(0, 1, {255});
  CameraCalibration camera = HandheldRig("x").factory.cameras[0];
  camera.line_delay_s = 50e-6;
  std::vector<std::size_t> seen(scene.boxes.size() + 1, 0);
  int wrong = 0;
  int pixels = 0;
  for (const double t_s : {1.0, 3.0, 5.0, 7.0, 9.0}) {
    const cv::Mat image = Rendered(camera, scene, *trajectory, t_s, 0);
    for (int v = 0; v < camera.height_px; v += 3) {
      const double row_s = t_s + v * *camera.line_delay_s;
      const BodyMotion motion = trajectory->At(row_s);
      const Eigen::Quaterniond q_GC = motion.q_GI * camera.q_CI.conjugate();
      const Eigen::Vector3d p_GC = motion.p_GI - q_GC * camera.p_CI;
      for (int u = 0; u < camera.width_px; u += 3) {
        Eigen::Vector3d bearing_C;
        ASSERT_TRUE(Unproject(camera, {u, v}, &bearing_C));
        const auto hit = Cast(scene, p_GC, q_GC * bearing_C, row_s);
        ASSERT_TRUE(hit);
        ++seen[static_cast<std::size_t>(hit->surface)];
        // The axis of the face on which the point lies.
        int axis = 0;
        (hit->p_B.cwiseAbs() - scene.Surface(hit->surface).half_m)
            .cwiseAbs()
            .minCoeff(&axis);
        const float difference =
            std::abs(image.at<float>(v, u) - kFaceBrightness[axis]);
        if (difference > 1e-3F) ++wrong;
        ++pixels;
      }
    }
  }
  // Pixels on edges see two faces.
  EXPECT_LT(wrong, 0.02 * pixels);
  EXPECT_GT(std::count_if(
                seen.begin(), seen.end(), [](std::size_t n) { return n > 50; }),
            12);
  EXPECT_TRUE(std::any_of(
      seen.end() - 4, seen.end(), [](std::size_t n) { return n > 50; }));
}

TEST(CameraRenderer, TextureDoesNotAlias) {
  // Squares far smaller than a pixel are grey, not a moiré.
  Scene scene{MakeCheckerTexture(8, 0.5e-3, 1, 0, 255), {}, {}, {}};
  scene.room.half_m = {2, 2, 2};
  scene.offsets = {Eigen::Vector2d::Zero()};
  const CameraCalibration camera = HandheldRig("x").factory.cameras[0];
  const SteadyMotion motion({0.1, 0.2, 0.3}, Eigen::Vector3d::Zero());
  const cv::Mat image = Rendered(camera, scene, motion, 2, {});
  for (int v = 0; v < image.rows; v += 7) {
    for (int u = 0; u < image.cols; u += 7) {
      const float grey = image.at<float>(v, u);
      float nearest = 1;
      for (const float brightness : kFaceBrightness) {
        nearest = std::min(nearest, std::abs(grey - brightness * 128 / 255));
      }
      // An edge between two faces is in between.
      ASSERT_TRUE(nearest < 0.005 || (grey > 0.34 && grey < 0.51))
          << u << " " << v << " " << grey;
    }
  }
}

TEST(CameraRenderer, PixelsWithoutARayAreBlack) {
  // Double sphere: the image circle of a long lens ends inside the image.
  CameraCalibration camera =
      ForwardCamera(LensRig(DistortionModel::kFov).factory.cameras[0]);
  for (const DistortionModel model : DistortionModels()) {
    if (DistortionName(model) != "double-sphere") continue;
    camera = ForwardCamera(LensRig(model).factory.cameras[0]);
  }
  camera.f /= 4;
  const SteadyMotion rest(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  const cv::Mat image = Rendered(camera, ChessRoom(), rest, 1, {});
  Eigen::Vector3d bearing_C;
  ASSERT_FALSE(Unproject(camera, {2, 2}, &bearing_C));
  ASSERT_TRUE(Unproject(camera, camera.c, &bearing_C));
  EXPECT_EQ(image.at<float>(2, 2), 0);
  EXPECT_GT(image.at<float>(322, 318), 0.1);
}

}  // namespace
}  // namespace selfcal
