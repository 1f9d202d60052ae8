#include "test/evaluation/experiments.h"

namespace selfcal {

// One file each: <name>_experiment.cc.
void RunDatasets(Context* context);

const std::vector<Experiment>& Experiments() {
  static const std::vector<Experiment> all = {
      {"datasets",
       "the 15 datasets: motion, size, what their segments say",
       RunDatasets},
  };
  return all;
}

}  // namespace selfcal
