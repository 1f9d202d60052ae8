#include "core/selection/fit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

#include "core/model/median.h"

namespace selfcal {
namespace {

// Returns the lower median of at least one value.
double Median(std::vector<double> values) {
  const auto middle =
      values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Ignores fits that were not measured; nullopt with fewer than `min_compared`.
std::optional<double> LargestOf(const std::vector<double>& fits,
                                const FitPolicy& policy) {
  std::vector<double> measured;
  std::copy_if(
      fits.begin(), fits.end(), std::back_inserter(measured), [](double fit) {
        return std::isfinite(fit) && fit > 0;
      });
  if (measured.empty() || std::ssize(measured) < policy.min_compared) {
    return std::nullopt;
  }
  const double usual = Median(measured);
  for (double& fit : measured) fit = std::abs(fit - usual);
  const double sigma = kMadToSigma * Median(std::move(measured));
  return std::clamp(usual + policy.max_deviations * sigma,
                    policy.least_ratio * usual,
                    policy.max_ratio * usual);
}

}  // namespace

std::optional<double> LargestFit(const std::vector<double>& newest,
                                 const std::vector<double>& kept,
                                 const FitPolicy& policy) {
  std::optional<double> largest = LargestOf(newest, policy);
  const std::optional<double> of_kept = LargestOf(kept, policy);
  if (of_kept && (!largest || *of_kept < *largest)) largest = of_kept;
  if (!largest) return std::nullopt;
  return std::max(1.0, *largest);
}

}  // namespace selfcal
