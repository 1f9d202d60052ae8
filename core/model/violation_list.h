// Collects violations while a value is validated; internal to core/model.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/model/segment.h"

namespace selfcal {

// Formats a number for a message.
inline std::string Readable(double value) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return text.data();
}

// "keyframes[3].q_GI"
inline std::string ElementPath(std::string_view list,
                               std::size_t index,
                               std::string_view member) {
  std::string path(list);
  path += '[' + std::to_string(index) + ']';
  if (!member.empty()) path += '.';
  path += member;
  return path;
}

class ViolationList {
 public:
  explicit ViolationList(int max_violations)
      : max_violations_(std::max(max_violations, 0)) {}

  void Add(std::string field, std::string message) {
    if (violations_.size() >= static_cast<std::size_t>(max_violations_)) {
      cut_ = true;
      return;
    }
    violations_.push_back({std::move(field), std::move(message)});
  }

  // Returns true if violations were dropped: no more are recorded, and loops
  // over long lists may end.
  bool cut() const { return cut_; }

  // Returns the violations; if some were dropped, the last entry reports that.
  std::vector<Violation> Take() {
    if (cut_) {
      violations_.push_back({"",
                             "only the first " +
                                 std::to_string(max_violations_) +
                                 " violations are listed; there are more"});
    }
    return std::move(violations_);
  }

 private:
  int max_violations_;
  bool cut_ = false;
  std::vector<Violation> violations_;
};

// Describes the fault of a rotation; empty if there is none.
inline std::string QuaternionFault(const Eigen::Quaterniond& q,
                                   double tolerance) {
  if (!q.coeffs().allFinite()) return "is not finite";
  const double norm = q.coeffs().stableNorm();
  if (std::abs(norm - 1) <= tolerance) return "";
  return "norm is " + Readable(norm) + "; send a unit quaternion";
}

// Describes the fault of a vector that must be finite and no longer than
// `limit`; empty if there is none.
template <class Vector>
std::string VectorFault(const Vector& v, double limit, std::string_view unit) {
  if (!v.allFinite()) return "is not finite";
  const double norm = v.stableNorm();
  if (norm <= limit) return "";
  return "magnitude " + Readable(norm) + " " + std::string(unit) +
         " is over the limit of " + Readable(limit);
}

}  // namespace selfcal
