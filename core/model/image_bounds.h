// The borders of a camera's image and of its rays, and what to do with the few
// observations beyond the former that a tracker reports.
//
// Pure functions, callable from any thread.
#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

// True if the pixel is finite and no further than the margin outside the image.
bool IsInImage(const CameraCalibration& camera,
               const Eigen::Vector2d& z_px,
               double margin_px);

// The rays of a camera may end within its image, where the model is no longer
// one-to-one: pixels further from the principal point have no ray. Those that
// have one are star-shaped about the principal point.

// True if every pixel of the image, and up to the margin outside, has a ray.
bool CoversImage(const CameraCalibration& camera, double margin_px);

// Distance [px] from a pixel that has a ray to the last one that has, away from
// the principal point; at most `reach_px`, and accurate to 1/1000 of it.
double DistanceToLastRay(const CameraCalibration& camera,
                         const Eigen::Vector2d& z_px,
                         double reach_px);

// A larger part of the observations of a segment outside the image is not due
// to a tracker: it stems from another camera, or from another resolution.
inline constexpr double kMaxOutsideFraction = 0.02;

// Number of observations outside the image of their camera by more than
// limits.pixel_margin_px, with finite pixels and a camera of the rig, if they
// are at most kMaxOutsideFraction of all; otherwise 0.
std::size_t CountStrayObservations(const MotionSegment& segment,
                                   const Calibration& theta,
                                   const SegmentLimits& limits = {});

// Removes the observations that CountStrayObservations counts. The landmarks
// remain, also those that have lost all observations.
void RemoveStrayObservations(const Calibration& theta,
                             const SegmentLimits& limits,
                             MotionSegment* segment);

}  // namespace selfcal
