// Defines each setting: name, variable, limits and help text.
#pragma once

#include <CLI/CLI.hpp>

#include "server/daemon/options.h"

namespace selfcal::server {

// Selects whether settings are also read from the environment.
enum class Environment { kUse, kIgnore };

// Defines an option for each setting; it writes to *options if it is given.
void DefineSettings(CLI::App* app,
                    Environment environment,
                    DaemonOptions* options);

}  // namespace selfcal::server
