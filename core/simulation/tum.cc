#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string_view>

#include "core/simulation/trajectory.h"

namespace selfcal {
namespace {

constexpr std::string_view kBlank = " \t\r";
constexpr std::size_t kFields = 8;

// Removes the first word from *rest and returns it; empty at the end.
std::string_view TakeWord(std::string_view* rest) {
  const std::size_t begin = rest->find_first_not_of(kBlank);
  if (begin == std::string_view::npos) {
    *rest = {};
    return {};
  }
  rest->remove_prefix(begin);
  const std::size_t length =
      std::min(rest->find_first_of(kBlank), rest->size());
  const std::string_view word = rest->substr(0, length);
  rest->remove_prefix(length);
  return word;
}

// Returns the reason why the line is not a pose; empty if it is one.
std::string ParseLine(std::string_view line, TimedPose* pose) {
  std::array<double, kFields> x{};
  std::size_t count = 0;
  for (std::string_view word = TakeWord(&line); !word.empty();
       word = TakeWord(&line)) {
    if (count == kFields) return "more than 8 numbers";
    const char* const end = word.data() + word.size();
    const auto [stop, status] = std::from_chars(word.data(), end, x[count]);
    if (status != std::errc() || stop != end || !std::isfinite(x[count])) {
      return fmt::format("'{}' is not a finite number", word);
    }
    ++count;
  }
  if (count != kFields) {
    return fmt::format("{} numbers instead of t tx ty tz qx qy qz qw", count);
  }
  pose->t_s = x[0];
  pose->p_GI = {x[1], x[2], x[3]};
  pose->q_GI = Eigen::Quaterniond(x[7], x[4], x[5], x[6]);
  const double norm = pose->q_GI.norm();
  if (!(std::abs(norm - 1) < 0.01)) {
    return fmt::format("norm of the quaternion is {:.4f} instead of 1", norm);
  }
  pose->q_GI.normalize();
  return {};
}

}  // namespace

bool ParseTum(const std::string& text,
              std::vector<TimedPose>* poses,
              std::string* error) {
  poses->clear();
  std::string_view rest = text;
  for (int number = 1; !rest.empty(); ++number) {
    const std::size_t length = std::min(rest.find('\n'), rest.size());
    const std::string_view line = rest.substr(0, length);
    rest.remove_prefix(std::min(length + 1, rest.size()));
    const std::size_t begin = line.find_first_not_of(kBlank);
    if (begin == std::string_view::npos || line[begin] == '#') continue;
    TimedPose pose;
    const std::string problem = ParseLine(line, &pose);
    if (!problem.empty()) {
      *error = fmt::format("line {}: {}", number, problem);
      return false;
    }
    poses->push_back(pose);
  }
  return true;
}

}  // namespace selfcal
