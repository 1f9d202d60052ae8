// Loops of trials: few in every run of the tests, as many as SELFCAL_TRIALS
// says where that is set. Each ends with a line that says what it has proven.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>

namespace selfcal {

inline int Trials(int few) {
  const char* wanted = std::getenv("SELFCAL_TRIALS");
  const int trials = wanted ? std::atoi(wanted) : 0;
  return trials > 0 ? trials : few;
}

// Prints the line when it goes: `lost` counts what the promise was broken for.
class Promise {
 public:
  explicit Promise(std::string name) : name_(std::move(name)) {}
  ~Promise() {
    std::printf("promise: %s trials %d lost %d\n", name_.c_str(), trials, lost);
    std::fflush(stdout);
    EXPECT_GT(trials, 0) << name_ << " was not tried";
    EXPECT_EQ(lost, 0) << name_;
  }
  Promise(const Promise&) = delete;
  Promise& operator=(const Promise&) = delete;

  int trials = 0;
  int lost = 0;

 private:
  std::string name_;
};

}  // namespace selfcal
