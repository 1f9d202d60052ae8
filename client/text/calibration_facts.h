// What a calibration is, where it came from and what was checked, in words.
#pragma once

#include <string>
#include <vector>

#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::client {

struct Fact {
  std::string name;
  std::string text;
};

// State, verdict, provenance, validation and the solver's report, what was held
// constant in words. A name may come more than once.
std::vector<Fact> CalibrationFacts(const v1::Calibration& calibration);

}  // namespace selfcal::client
