// Agreement of each segment of a calibration with all others. Values.
#pragma once

#include <string>

#include "core/calibration/agreement.h"
#include "core/model/segment.h"

namespace selfcal {

struct SegmentFit {
  SegmentKey key;
  // Root mean square of its reprojection residuals over the prediction of the
  // noise that the calibration used, 1 if the model holds; and that of its
  // whitened inertial residuals over the median of all segments. 0: not
  // measured.
  double pixel_ratio = 0;
  double inertial_ratio = 0;
  // Its own estimate of theta tested against that of all others.
  AgreementTest others;
  // Reason why the result does not use the segment; empty if it does.
  std::string excluded;
};

}  // namespace selfcal
