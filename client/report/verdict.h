// What a calibration is good for, in one word and the sentences behind it.
#pragma once

#include <string>
#include <vector>

#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::client {

enum class VerdictKind {
  kGood,
  kUntested,  // nothing but the fit itself speaks for it
  kWeak,
  kInconsistent,
  kRejected,
  kFactory,
};

struct Verdict {
  VerdictKind kind = VerdictKind::kGood;
  std::vector<std::string> sentences;
};

// `factory` is version 1 of the rig: its sigmas are what was known before.
Verdict Judge(const v1::Calibration& calibration,
              const v1::Calibration& factory);

// "good", "weak in these directions", ...
std::string VerdictText(VerdictKind kind);

// The sigma before of a component; 0 if it was not estimated.
double SigmaBefore(const v1::Calibration& factory,
                   const std::string& component);

}  // namespace selfcal::client
