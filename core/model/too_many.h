// The rule for lists that are too long, wherever they are counted.
#pragma once

#include <cstddef>
#include <string>

namespace selfcal {

// Message of a violation.
inline std::string TooMany(std::size_t count, std::size_t most) {
  return "has " + std::to_string(count) + " elements; at most " +
         std::to_string(most) + " are allowed";
}

}  // namespace selfcal
