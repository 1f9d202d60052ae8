// The experiments of the evaluation: one function each, in one list.
#pragma once

#include <string>
#include <vector>

#include "test/evaluation/context.h"

namespace selfcal {

struct Experiment {
  std::string name;   // [a-z0-9_], its folder in the output, and for --only
  std::string about;  // one line
  void (*run)(Context* context);
};

// All of them, in the order in which they run.
const std::vector<Experiment>& Experiments();

}  // namespace selfcal
