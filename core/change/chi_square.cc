#include "core/change/chi_square.h"

#include <cmath>
#include <numbers>

namespace selfcal {

double ChiSquareTail(double statistic, int degrees) {
  const double x = statistic / 2;
  if (!(x > 0)) return 1;
  const bool odd = degrees % 2 == 1;
  // Terms x^a e^-x / Gamma(a + 1), computed by their logarithm: x^a alone may
  // overflow.
  double a = odd ? 0.5 : 0;
  double log_term = -x;
  if (odd) log_term += std::log(2 * std::sqrt(x / std::numbers::pi));
  double tail = odd ? std::erfc(std::sqrt(x)) : 0;
  for (int i = 0; i < degrees / 2; ++i) {
    tail += std::exp(log_term);
    a += 1;
    log_term += std::log(x / a);
  }
  return tail;
}

}  // namespace selfcal
