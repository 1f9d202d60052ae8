// Builds and parses resource names (AIP-122).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/model/segment.h"

namespace selfcal {

// rigs/{rig}
std::string RigName(std::string_view rig);
std::optional<std::string> ParseRigName(std::string_view name);

// rigs/{rig}/segments/{session}~{index}; characters of the session other than
// letters, digits, '-', '_' and '.' are percent-encoded.
std::string SegmentName(std::string_view rig, const SegmentKey& key);
struct SegmentNameParts {
  std::string rig;
  SegmentKey key;
};
std::optional<SegmentNameParts> ParseSegmentName(std::string_view name);

// rigs/{rig}/{collection}/{id} for the other collections (tables, calibrations,
// recalibrations).
std::string ChildName(std::string_view rig,
                      std::string_view collection,
                      std::string_view id);
struct ChildNameParts {
  std::string rig;
  std::string id;
};
std::optional<ChildNameParts> ParseChildName(std::string_view name,
                                             std::string_view collection);

}  // namespace selfcal
