// What takes bytes from outside, as functions of these bytes alone. A fuzzer
// calls them (fuzzer.cc), and so does the normal test (replay_test.cc), on the
// corpus and on changed copies of it.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace selfcal {

struct FuzzTarget {
  std::string name;  // also the folder of its corpus
  // Must return whatever the bytes are. Aborts, through FuzzCheck, where a
  // promise is broken that no sanitizer would notice.
  void (*run)(std::string_view bytes);
};

const std::vector<FuzzTarget>& FuzzTargets();

// A segment on its way in: parsed, converted, validated, and scored if nothing
// was found against it.
void FuzzSegment(std::string_view bytes);
// A rig: parsed, converted, validated.
void FuzzRig(std::string_view bytes);
// The part file of a VI-map, before it is compressed.
void FuzzViMap(std::string_view bytes);
// The text of a VI-map's sensors.yaml.
void FuzzSensors(std::string_view bytes);
// The daemon's file of settings.
void FuzzConfig(std::string_view bytes);

// Ends the process with the sentence if it does not hold.
void FuzzCheck(bool holds, const char* sentence);

}  // namespace selfcal
