#pragma once

#include <algorithm>
#include <span>
#include <vector>

namespace selfcal {

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
