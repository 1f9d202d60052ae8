// The dense kernels for a vector width that is known at run time. Internal to
// core/elimination.
#pragma once

#include "core/elimination/dense_lanes.h"
#include "core/simd/vector_width.h"

namespace selfcal {

// Calls function(kernels) with DenseLanes<W>.
template <typename Function>
void WithKernels(VectorWidth width, const Function& function) {
  WithLanes(width, [&]<int W>() { function(DenseLanes<W>()); });
}

}  // namespace selfcal
