// Stands in for the experiment on rendered recordings, in a build without
// OpenCV.
#include <stdexcept>

#include "test/evaluation/context.h"

namespace selfcal {

void RunRecordingsRaw(Context*) {
  throw std::runtime_error("this build was made without OpenCV");
}

}  // namespace selfcal
