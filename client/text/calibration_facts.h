// A calibration in words: its state, origin and checks.
#pragma once

#include <string>
#include <vector>

#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::client {

struct Fact {
  std::string name;
  std::string text;
};

// State, verdict, provenance, validation and the solver's report, with the
// directions that were held constant in words. Names may repeat.
std::vector<Fact> CalibrationFacts(const v1::Calibration& calibration);

}  // namespace selfcal::client
