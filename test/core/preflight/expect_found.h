// What a planted mistake must lead to.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "test/core/preflight/mistakes.h"

namespace selfcal {

// Exactly the findings of `mistake`, with its cause, remedy and value (to 5 %,
// or 3 ms of an offset: recordings have some of their own).
inline void ExpectFound(const Mistake& mistake, const FedData& clean) {
  SCOPED_TRACE(mistake.name);
  FedData fed = clean;
  mistake.plant(&fed);
  const Diagnosis diagnosis = fed.Diagnose();
  ASSERT_EQ(Kinds(diagnosis), mistake.found) << Text(diagnosis);
  const Finding& first = diagnosis.findings.front();
  EXPECT_NE(first.cause.find(mistake.cause), std::string::npos)
      << Text(diagnosis);
  EXPECT_NE(first.remedy.find(mistake.remedy), std::string::npos)
      << Text(diagnosis);
  if (mistake.value == 0) return;
  EXPECT_NEAR(first.value,
              mistake.value,
              std::max(0.05 * std::abs(mistake.value), 3e-3))
      << Text(diagnosis);
}

}  // namespace selfcal
