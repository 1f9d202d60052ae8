// The patch about a point as it was first seen, and where it is in another
// image: an affine warp, a gain and an offset of the grey (inverse
// compositional, Baker and Matthews 2004). What lens and perspective bend
// beyond the affine warp is known (patch_plane.h): left out, the lens would
// move points towards the middle of a wide-angle image by a hundredth of a
// pixel, and with them the focal length.
//
// Tracks that are aligned to their first patch do not drift, as they would from
// image to image, and a rotation of the camera does not move them. Immutable
// once made; any thread may align.
#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core.hpp>

#include "client/tracking/patch_plane.h"

namespace selfcal::client {

// Takes a point x of the patch, relative to its centre, to A x + z of the
// image, to first order.
struct PatchWarp {
  Eigen::Matrix2d A = Eigen::Matrix2d::Identity();
  Eigen::Vector2d z_px = Eigen::Vector2d::Zero();
};

class PatchTemplate {
 public:
  // Half the side of a patch.
  static constexpr int kReach_px = 8;

  // Images are of 8 bits, and smoothed, as their greys are interpolated.
  // Requires the point to be kReach_px + 2 inside the image.
  PatchTemplate(const cv::Mat& image,
                const Eigen::Vector2d& z_px,
                const PatchPlane& plane);

  // Aligns the patch to an image, from a warp that is wrong by about a pixel,
  // to a place with this plane. Returns the correlation of the greys of both,
  // in
  // [-1, 1], or 0 if the warp leaves the image or does not converge; then *warp
  // is unchanged.
  double Align(const cv::Mat& image,
               const PatchPlane& plane,
               PatchWarp* warp) const;

 private:
  static constexpr int kSide = 2 * kReach_px + 1;
  static constexpr int kPixels = kSide * kSide;
  static constexpr int kParameters = 8;  // A by rows, z, gain, offset

  using Values = Eigen::Matrix<float, kPixels, 1>;

  bool Sample(const cv::Mat& image,
              const PatchWarp& warp,
              const LensCurvature& bend,
              Values* values) const;

  PatchPlane plane_;
  Values greys_;
  Values weights_;
  // Derivatives of the greys by the parameters, times the weights.
  Eigen::Matrix<float, kPixels, kParameters> weighted_;
  Eigen::Matrix<double, kParameters, kParameters> inverse_;
};

}  // namespace selfcal::client
