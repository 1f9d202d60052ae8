#include "core/simd/vector_width.h"

namespace selfcal {

bool HasVectors(VectorWidth width) {
  switch (width) {
    case VectorWidth::k2:
      return true;
#if defined(__x86_64__)
    case VectorWidth::k4:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    case VectorWidth::k8:
      return __builtin_cpu_supports("avx512f") &&
             __builtin_cpu_supports("avx512dq") &&
             __builtin_cpu_supports("avx512vl");
#else
    default:
      return false;
#endif
  }
  return false;
}

VectorWidth WidestVectors() {
  if (HasVectors(VectorWidth::k8)) return VectorWidth::k8;
  if (HasVectors(VectorWidth::k4)) return VectorWidth::k4;
  return VectorWidth::k2;
}

std::string_view VectorWidthName(VectorWidth width) {
  switch (width) {
    case VectorWidth::k2:
      return "portable";
    case VectorWidth::k4:
      return "avx2";
    case VectorWidth::k8:
      return "avx512";
  }
  return "unknown";
}

}  // namespace selfcal
