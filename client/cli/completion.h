// Completion scripts for shells, generated from the commands of the command
// line.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace selfcal::client {

std::string BashCompletion(const CLI::App& app);
std::string ZshCompletion(const CLI::App& app);
std::string FishCompletion(const CLI::App& app);

}  // namespace selfcal::client
