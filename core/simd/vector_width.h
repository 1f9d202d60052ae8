// Vector units of this machine: the kernels of the project are compiled once
// for each width, and one of them is selected at run time.
//
// A file that defines kernels is listed under LANES of its module and compiled
// for each width, with SELFCAL_LANES numbers in a vector.
#pragma once

#include <string_view>

namespace selfcal {

enum class VectorWidth {
  k2 = 2,  // 128 bit: every x86-64 (SSE2) and aarch64
  k4 = 4,  // 256 bit: AVX2 with FMA
  k8 = 8,  // 512 bit: AVX-512 F, DQ and VL
};

// The widest that both this machine and this program support.
VectorWidth WidestVectors();

// Returns true if the width can be used on this machine.
bool HasVectors(VectorWidth width);

std::string_view VectorWidthName(VectorWidth width);

// Calls f.operator()<W>() for the width; one that was not compiled for this
// architecture uses the portable one.
template <typename Function>
decltype(auto) WithLanes([[maybe_unused]] VectorWidth width, Function&& f) {
#if defined(__x86_64__)
  if (width == VectorWidth::k8) return f.template operator()<8>();
  if (width == VectorWidth::k4) return f.template operator()<4>();
#endif
  return f.template operator()<2>();
}

}  // namespace selfcal
