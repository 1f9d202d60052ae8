#include "test/evaluation/experiments.h"

namespace selfcal {

// One file each: <name>_experiment.cc.
void RunDatasets(Context* context);
void RunRecordedChoice(Context* context);
void RunRecordings(Context* context);
void RunSensors(Context* context);

const std::vector<Experiment>& Experiments() {
  static const std::vector<Experiment> all = {
      {"datasets",
       "the 15 datasets: motion, size, what their segments say",
       RunDatasets},
      {"recordings",
       "real recordings before and after; are sigmas honest there?",
       RunRecordings},
      {"recorded_choice",
       "which choice of segments does best on a real recording",
       RunRecordedChoice},
      {"sensors",
       "one, two and four cameras, with time offsets known, estimated, ignored",
       RunSensors},
  };
  return all;
}

}  // namespace selfcal
