// What the benchmark prints and writes.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "test/performance/cases.h"

namespace selfcal {

struct Result {
  Case what;
  Measurement measured;
};

// One line of a table.
std::string TableLine(const Result& result);
std::string TableHead();

// A JSON list: case, ratio, must and goal (where there are), higher_is_better
// (where false), and the figures.
void WriteJson(const std::vector<Result>& results, std::ostream& to);

}  // namespace selfcal
