// Replaces ceres_elimination.cc in a build without Ceres (SELFCAL_CERES=OFF).
#include <stdexcept>

#include "core/verify/ceres_elimination.h"
#include "core/verify/scorer.h"

namespace selfcal {

bool HasCeres() { return false; }

LinearisedSegment EliminateByCeres(const Rig&,
                                   const Calibration&,
                                   const MotionSegment&,
                                   const InlierSelection&,
                                   int) {
  throw std::runtime_error(
      "this program was built without Ceres; choose the scorer "
      "\"structured\"");
}

}  // namespace selfcal
