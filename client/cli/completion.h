// Scripts that complete the command line in a shell, made from the commands
// that it has.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace selfcal::client {

std::string BashCompletion(const CLI::App& app);
std::string ZshCompletion(const CLI::App& app);
std::string FishCompletion(const CLI::App& app);

}  // namespace selfcal::client
