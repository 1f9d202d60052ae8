// Promises of docs/reliability.md: loops with as many trials as SELFCAL_TRIALS
// says, and a line for each at their end.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>

namespace selfcal::server {

inline int Trials(int few) {
  const char* text = std::getenv("SELFCAL_TRIALS");
  const int trials = text == nullptr ? 0 : std::atoi(text);
  return trials > 0 ? trials : few;
}

inline void ReportPromise(const std::string& name, int trials, int lost) {
  std::printf("promise: %s trials %d lost %d\n", name.c_str(), trials, lost);
  std::fflush(stdout);
}

}  // namespace selfcal::server
