// Corners, optical flow and aligned patches on textures that are warped
// exactly.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "client/tracking/corner_grid.h"
#include "client/tracking/patch_flow.h"
#include "client/tracking/patch_template.h"

namespace selfcal::client {
namespace {

constexpr int kSize_px = 160;

// A smooth texture: waves of many directions.
double GreyOf(double x, double y, int seed) {
  double grey = 0;
  for (int k = 1; k <= 8; ++k) {
    const double angle = 2.4 * k + seed;
    const double length_px = 8 + 3 * k;
    grey += std::sin((std::cos(angle) * x + std::sin(angle) * y) * 6.2832 /
                         length_px +
                     k * k + seed);
  }
  return 128 + 13 * grey;
}

// The texture at A^-1 (z - t), times a gain.
cv::Mat Warped(const Eigen::Matrix2d& A,
               const Eigen::Vector2d& t,
               double gain = 1,
               int seed = 1) {
  cv::Mat image(kSize_px, kSize_px, CV_8UC1);
  const Eigen::Matrix2d back = A.inverse();
  for (int v = 0; v < kSize_px; ++v) {
    for (int u = 0; u < kSize_px; ++u) {
      const Eigen::Vector2d p = back * (Eigen::Vector2d(u, v) - t);
      image.at<std::uint8_t>(v, u) =
          cv::saturate_cast<std::uint8_t>(gain * GreyOf(p.x(), p.y(), seed));
    }
  }
  return image;
}

TEST(PatchTemplate, FindsTheAffineWarpOfItsSurroundings) {
  const cv::Mat first = Warped(Eigen::Matrix2d::Identity(), {0, 0});
  Eigen::Matrix2d A;
  A << 1.05, -0.32, 0.28, 0.93;
  const Eigen::Vector2d t(21.3, -9.6);
  for (const double gain : {0.6, 1.0, 1.15}) {
    const cv::Mat second = Warped(A, t, gain);
    for (const Eigen::Vector2d& z :
         {Eigen::Vector2d(70, 80), {50.3, 90.7}, {85, 60}}) {
      const PatchTemplate patch(first, z, PatchPlane());
      PatchWarp warp;
      // A prediction that is wrong by a pixel and some degrees.
      warp.A << 1, -0.26, 0.24, 0.97;
      warp.z_px = A * z + t + Eigen::Vector2d(0.8, -0.6);
      EXPECT_GT(patch.Align(second, PatchPlane(), &warp), 0.99);
      EXPECT_LT((warp.z_px - (A * z + t)).norm(), 0.03);
      EXPECT_LT((warp.A - A).norm(), 0.03);
    }
  }
}

TEST(PatchTemplate, DoesNotResembleAnotherTexture) {
  const cv::Mat first = Warped(Eigen::Matrix2d::Identity(), {0, 0});
  const cv::Mat other = Warped(Eigen::Matrix2d::Identity(), {0, 0}, 1, 5);
  int alike = 0;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector2d z(30 + 2 * i, 130 - 2 * i);
    PatchWarp warp;
    warp.z_px = z;
    const PatchTemplate patch(first, z, PatchPlane());
    if (patch.Align(other, PatchPlane(), &warp) > 0.8) ++alike;
  }
  // Eight parameters find some resemblance now and then.
  EXPECT_LE(alike, 3);
}

TEST(PatchTemplate, ReportsPatchesThatLeaveTheImageAndKeepsTheirWarp) {
  const cv::Mat image = Warped(Eigen::Matrix2d::Identity(), {0, 0});
  const PatchTemplate patch(image, {80, 80}, PatchPlane());
  for (const Eigen::Vector2d& z :
       {Eigen::Vector2d(7, 80), {80, 152.5}, {-1e9, 4}, {std::nan(""), 80}}) {
    PatchWarp warp;
    warp.z_px = z;
    EXPECT_EQ(patch.Align(image, PatchPlane(), &warp), 0);
    EXPECT_EQ(warp.A, Eigen::Matrix2d::Identity());
  }
}

TEST(PatchFlow, FollowsAShiftAndRejectsWhatIsNotThere) {
  const Eigen::Vector2d shift(6.4, -3.3);
  const cv::Mat first = Warped(Eigen::Matrix2d::Identity(), {0, 0});
  cv::Mat second = Warped(Eigen::Matrix2d::Identity(), shift);
  // A part of the image shows something else.
  const cv::Mat other = Warped(Eigen::Matrix2d::Identity(), {0, 0}, 1, 5);
  const cv::Rect hidden(0, 0, 70, kSize_px);
  other(hidden).copyTo(second(hidden));
  FlowOptions options;
  const std::vector<cv::Point2f> points = {
      {100, 60}, {120, 90}, {110, 120}, {25, 60}, {30, 100}, {40, 130}};
  std::vector<cv::Point2f> found = points;
  const std::vector<char> ok = FollowPatches(BuildPyramid(first, options),
                                             BuildPyramid(second, options),
                                             points,
                                             options,
                                             &found);
  ASSERT_EQ(ok.size(), points.size());
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(ok[i]);
    EXPECT_NEAR(found[i].x, points[i].x + shift.x(), 0.05);
    EXPECT_NEAR(found[i].y, points[i].y + shift.y(), 0.05);
  }
  for (int i = 3; i < 6; ++i) EXPECT_FALSE(ok[i]) << i;
}

TEST(PatchFlow, BrightnessRatioIsThatOfTheGain) {
  const cv::Mat first = Warped(Eigen::Matrix2d::Identity(), {0, 0});
  const cv::Mat second = Warped(Eigen::Matrix2d::Identity(), {0, 0}, 0.8);
  // A point too near to the border is left out.
  const std::vector<cv::Point2f> points = {{50, 50}, {90, 70}, {2, 2}};
  EXPECT_NEAR(BrightnessRatio(first, second, points, points, 21), 0.8, 0.01);
  EXPECT_EQ(BrightnessRatio(first, second, {}, {}, 21), 1);
}

cv::Mat Chessboard(int square_px) {
  cv::Mat image(240, 320, CV_8UC1, cv::Scalar(128));
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const bool dark = (u / square_px + v / square_px) % 2 == 0;
      image.at<std::uint8_t>(v, u) = dark ? 60 : 190;
    }
  }
  return image;
}

TEST(CornerGrid, FindsTheCornersOfSquaresOneInEachFreeCell) {
  CornerOptions options;
  const std::vector<cv::Point2f> corners =
      FindCorners(Chessboard(40), {}, options);
  EXPECT_GT(corners.size(), 25u);
  EXPECT_LE(corners.size(), 48u);
  for (const cv::Point2f& corner : corners) {
    EXPECT_NEAR(std::remainder(corner.x + 0.5, 40), 0, 2.5);
    EXPECT_NEAR(std::remainder(corner.y + 0.5, 40), 0, 2.5);
  }
  for (std::size_t i = 0; i < corners.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GE(cv::norm(corners[i] - corners[j]), options.min_distance_px);
    }
  }
}

TEST(CornerGrid, LeavesCellsWithTracksAndFlatImagesAlone) {
  CornerOptions options;
  const std::vector<cv::Point2f> taken = {{100, 100}, {61, 70}};
  for (const cv::Point2f& corner :
       FindCorners(Chessboard(20), taken, options)) {
    for (const cv::Point2f& point : taken) {
      EXPECT_GE(cv::norm(corner - point), options.min_distance_px);
      EXPECT_FALSE(cvFloor(corner.x) / 40 == cvFloor(point.x) / 40 &&
                   cvFloor(corner.y) / 40 == cvFloor(point.y) / 40);
    }
    EXPECT_GE(corner.x, options.border_px);
    EXPECT_LT(corner.y, 240 - options.border_px);
  }
  const cv::Mat flat(240, 320, CV_8UC1, cv::Scalar(77));
  EXPECT_TRUE(FindCorners(flat, {}, options).empty());
  // Noise of 2 greys is no corner.
  cv::Mat noise(240, 320, CV_8SC1);
  cv::RNG(1).fill(noise, cv::RNG::NORMAL, 0, 2);
  cv::Mat noisy;
  cv::add(flat, noise, noisy, cv::noArray(), CV_8U);
  EXPECT_TRUE(FindCorners(noisy, {}, options).empty());
}

}  // namespace
}  // namespace selfcal::client
