// A range of a quantity that a list is filtered by.
#pragma once

#include <optional>

namespace selfcal::server {

// A closed interval; nullopt means no bound.
template <typename T>
struct Range {
  std::optional<T> least;
  std::optional<T> most;

  friend bool operator==(const Range&, const Range&) = default;
};

}  // namespace selfcal::server
