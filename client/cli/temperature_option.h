// The option --temperature of commands that read or write values that vary with
// it.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

namespace selfcal::client {

// `what` begins the help; the unit follows.
void AddTemperature(CLI::App* command,
                    const std::string& what,
                    std::optional<double>* temperature_c);

}  // namespace selfcal::client
