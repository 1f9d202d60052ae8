// The parent of a list that is of one rig or of all.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "proto/resource_names.h"
#include "server/api/errors.h"

namespace selfcal::server {

// The {rig} of rigs/{rig}; empty for an empty parent, which means all rigs.
inline absl::StatusOr<std::string> RigOrAll(const std::string& parent) {
  if (parent.empty()) return std::string();
  const auto rig = ParseRigName(parent);
  if (!rig) return BadName("parent", "rigs/{rig}");
  return *rig;
}

}  // namespace selfcal::server
