// The settings, each defined once: name, variable, limits and explanation.
#pragma once

#include <CLI/CLI.hpp>

#include "server/daemon/options.h"

namespace selfcal::server {

// Which source the settings are taken from besides the arguments.
enum class Environment { kUse, kIgnore };

// Defines an option for each setting, which writes to *options when it is
// given.
void DefineSettings(CLI::App* app,
                    Environment environment,
                    DaemonOptions* options);

}  // namespace selfcal::server
