// Refines a start of rotation, time offset, bias and focal scale on the matches
// of pairs of images. Internal to core/initialisation.
//
// The distance of each match from its epipolar plane is minimised over these
// and the direction of translation of each pair, which is eliminated.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/initialisation/image_rays.h"
#include "core/initialisation/rotation_start.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

// Means and standard deviations in the order of the covariance of a start,
// independent of each other; that of a component that is held constant is 0.
struct StartPrior {
  RotationStart mean;
  Eigen::Matrix<double, kStartSize, 1> sigmas;
};

// Begins with an estimate. The samples are in order of time, with times
// relative to the same origin as the images; pairs beyond them are not used.
// Fills the covariance and residual_px; leaves `rays` at the focal scale of the
// result.
RotationStart RefineRotationStart(const RotationStart& begin,
                                  const StartPrior& prior,
                                  const ImuCalibration& imu,
                                  std::span<const ImuSample> samples,
                                  const std::vector<ImagePair>& pairs,
                                  RayImages* rays);

// a [-] b and b [+] delta, in the order of the covariance.
Eigen::Matrix<double, kStartSize, 1> BoxMinus(const RotationStart& a,
                                              const RotationStart& b);
RotationStart BoxPlus(const RotationStart& start,
                      const Eigen::Matrix<double, kStartSize, 1>& delta);

}  // namespace selfcal
