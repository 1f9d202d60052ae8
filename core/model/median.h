#pragma once

#include <algorithm>
#include <span>
#include <vector>

namespace selfcal {

// Median of the norm of a two-dimensional normal vector of unit sigma.
inline constexpr double kMedianOfRayleigh = 1.1774100225154747;
// Standard deviation over median distance to the median, of a normal
// distribution.
inline constexpr double kMadToSigma = 1.4826;

// The median of at least one value, and of an even number the larger of the two
// in the middle. Reorders the values.
template <typename T>
T UpperMedianInPlace(std::span<T> values) {
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

// The same of a copy; 0 of no value.
template <typename T>
T UpperMedian(std::vector<T> values) {
  return values.empty() ? T{} : UpperMedianInPlace(std::span(values));
}

}  // namespace selfcal
