// Errors of the command line itself, with what was probably meant.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace selfcal::client {

// Prints what was wrong and what leads on to stderr, or the help or version
// that was asked for to stdout. Returns the exit code.
int ReportUsage(CLI::App* app, const CLI::ParseError& error);

// Prints the help of the command that these words name to stdout. Returns the
// exit code.
int ShowHelp(const CLI::App& app, const std::vector<std::string>& words);

// The commands below this one that help shows.
std::vector<const CLI::App*> ShownCommands(const CLI::App& command);

}  // namespace selfcal::client
