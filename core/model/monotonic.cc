#include "core/model/monotonic.h"

#include <cassert>

namespace selfcal {
namespace {

template <std::size_t N>
bool Positive(const double* a) {
  // b_j = sum over i <= j of C(j, i) / C(N, i) a_i.
  std::array<double, N + 1> b;
  for (std::size_t j = 0; j <= N; ++j) {
    double weight = 1;
    b[j] = a[0];
    for (std::size_t i = 1; i <= j; ++i) {
      weight *= static_cast<double>(j - i + 1) / static_cast<double>(N - i + 1);
      b[j] += weight * a[i];
    }
  }
  constexpr int kHalvings = 40;
  return PositiveInBernsteinForm(b, kHalvings);
}

}  // namespace

bool PositiveOnUnitInterval(const double* a, int degree) {
  switch (degree) {
    case 2:
      return Positive<2>(a);
    case 3:
      return Positive<3>(a);
    case 4:
      return Positive<4>(a);
    default:
      assert(degree == 6);
      return Positive<6>(a);
  }
}

}  // namespace selfcal
