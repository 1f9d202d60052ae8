// Errors with a line for each violated field, no longer than a screen.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "core/model/segment.h"

namespace selfcal::client {

inline constexpr std::size_t kMostErrorLines = 20;

// The flag or argument that sets a field of a request, e.g. "--id" for
// "rig.name"; it also sets the fields within the field.
using FlagNames = std::map<std::string, std::string>;

// Returns the name under which a user knows the field.
std::string UserName(const std::string& field, const FlagNames& flags);

// Returns a line for each violation, each after a line break; after
// kMostErrorLines, how many more there are. `more` are not in the list.
std::string ErrorLines(const std::vector<Violation>& violations,
                       const FlagNames& flags = {},
                       std::size_t more = 0);

}  // namespace selfcal::client
