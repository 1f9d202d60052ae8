// Reads the files of one VI-map folder as messages: finds the part files,
// decompresses them and parses the protobuf. vi_map.cc interprets the messages.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "selfcal/vi_map/vi_map.pb.h"

namespace selfcal::client {

// Merges all part files that `folder`/vi_map/vi_map_metadata lists. DATA_LOSS
// for a truncated or damaged file, NOT_FOUND for a missing one, with its name.
absl::StatusOr<vi_map::ViMap> ReadViMapFiles(const std::string& folder);

}  // namespace selfcal::client
