// How well each segment of a calibration agrees with all others, and both
// halves of the segments with each other. Values.
#pragma once

#include <string>

#include "core/calibration/agreement.h"
#include "core/model/segment.h"

namespace selfcal {

struct SegmentFit {
  SegmentKey key;
  // Root mean square of its reprojection residuals over what the noise that the
  // calibration used predicts, 1 where the model holds; and that of its whitened
  // inertial residuals over the median of all segments. 0: not measured.
  double pixel_ratio = 0;
  double inertial_ratio = 0;
  // Its own estimate of theta against that of all others.
  AgreementTest others;
  // Why the result does not use the segment; empty if it does.
  std::string excluded;
};

}  // namespace selfcal
