// Expected findings for a planted mistake.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "test/core/preflight/mistakes.h"

namespace selfcal {

// Exactly the findings of `mistake`, with its cause, remedy and value (to 5 %,
// or 3 ms of an offset: recordings have some of their own). Returns whether the
// mistake is named so.
inline bool ExpectFound(const Mistake& mistake, const FedData& clean) {
  FedData fed = clean;
  mistake.plant(&fed);
  const Diagnosis diagnosis = fed.Diagnose();
  const bool kinds = Kinds(diagnosis) == mistake.found;
  EXPECT_TRUE(kinds) << mistake.name << "\n" << Text(diagnosis);
  if (!kinds) return false;
  const Finding& first = diagnosis.findings.front();
  const bool words = first.cause.find(mistake.cause) != std::string::npos &&
                     first.remedy.find(mistake.remedy) != std::string::npos;
  const double least = first.kind == FindingKind::kTimeOffset ? 3e-3 : 0;
  const double tolerance = std::max(0.05 * std::abs(mistake.value), least);
  const bool value =
      mistake.value == 0 || std::abs(first.value - mistake.value) <= tolerance;
  EXPECT_TRUE(words && value) << mistake.name << "\n" << Text(diagnosis);
  return words && value;
}

}  // namespace selfcal
