// The figures of the evaluation, each against its bound: summary.json.
#pragma once

#include <string>
#include <vector>

namespace selfcal {

enum class BoundKind { kAtMost, kAtLeast, kWithin };

// One figure. What must be reached and what would be better are two entries:
// "name" and "name.goal".
struct Figure {
  std::string experiment = "";
  std::string name = "";
  std::string unit = "";
  double value = 0;
  BoundKind kind = BoundKind::kAtMost;
  double low = 0;   // bound of kAtLeast, and of kWithin
  double high = 0;  // bound of kAtMost, and of kWithin
  // Holds with the few runs of the quick form as well.
  bool robust = false;

  bool Holds() const;
  // "<= 1.5", ">= 6", "in [0.8, 1.3]".
  std::string Bound() const;
};

// The text of summary.json: a list of {name, value, bound, holds, ...}; `bound`
// is a number, for kWithin a list of two. Entries of `old_text` (empty, or such
// a text) that are of other experiments than those named are kept, and come
// first. Throws std::exception if the old text is no such list.
std::string MergeSummary(const std::string& old_text,
                         const std::vector<std::string>& experiments,
                         const std::vector<Figure>& figures,
                         bool quick);

}  // namespace selfcal
