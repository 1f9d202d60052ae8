// Commands under the names that they had in earlier versions; help does not
// show them.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>

#include "client/cli/context.h"

namespace selfcal::client {

// The present spelling of each, e.g. "table show" of "tables". Nouns in the
// plural are aliases instead.
const std::map<std::string, std::string>& OldSpellings();

// Adds them to the command line.
void AddOldSpellings(CLI::App* app, Context* context);

}  // namespace selfcal::client
