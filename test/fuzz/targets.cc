#include "test/fuzz/targets.h"

#include <cstdio>
#include <cstdlib>

namespace selfcal {

const std::vector<FuzzTarget>& FuzzTargets() {
  static const std::vector<FuzzTarget> targets = {
      {"segment", FuzzSegment},
      {"rig", FuzzRig},
      {"vi_map", FuzzViMap},
      {"sensors", FuzzSensors},
      {"config", FuzzConfig},
  };
  return targets;
}

void FuzzCheck(bool holds, const char* sentence) {
  if (holds) return;
  std::fprintf(stderr, "broken: %s\n", sentence);
  std::abort();
}

}  // namespace selfcal
