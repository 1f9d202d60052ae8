// The files of one VI-map folder as messages: which parts there are, gzip, and
// the protobuf inside. What they mean is the business of vi_map.cc.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "client/import/vi_map.pb.h"

namespace selfcal::client {

// Content of a file. NOT_FOUND if it cannot be opened.
absl::StatusOr<std::string> ReadFile(const std::string& path);

// Merges all part files that `folder`/vi_map/vi_map_metadata names. DATA_LOSS
// for a truncated or damaged file, NOT_FOUND for a missing one, each naming it.
absl::StatusOr<vi_map::ViMap> ReadViMapFiles(const std::string& folder);

}  // namespace selfcal::client
