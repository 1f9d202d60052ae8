#include "core/selection/fit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

namespace selfcal {
namespace {

// Of what was measured; nothing with fewer than `least` of them.
std::optional<double> MedianFit(const std::vector<double>& fits, int least) {
  std::vector<double> measured;
  std::copy_if(
      fits.begin(), fits.end(), std::back_inserter(measured), [](double fit) {
        return std::isfinite(fit) && fit > 0;
      });
  if (measured.empty() || std::ssize(measured) < least) return std::nullopt;
  const auto middle =
      measured.begin() + static_cast<std::ptrdiff_t>((measured.size() - 1) / 2);
  std::nth_element(measured.begin(), middle, measured.end());
  return *middle;
}

}  // namespace

std::optional<double> LargestFit(const std::vector<double>& newest,
                                 const std::vector<double>& kept,
                                 const FitPolicy& policy) {
  std::optional<double> usual = MedianFit(newest, policy.min_compared);
  const std::optional<double> of_kept = MedianFit(kept, policy.min_compared);
  if (of_kept && (!usual || *of_kept < *usual)) usual = of_kept;
  if (!usual) return std::nullopt;
  return std::max(1.0, policy.max_ratio * *usual);
}

}  // namespace selfcal
