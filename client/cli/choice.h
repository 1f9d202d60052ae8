// Options whose value is one of a few words.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace selfcal::client {

// Validator of such an option; its error names the word that was meant.
CLI::Validator OneOf(const std::vector<std::string>& words);

}  // namespace selfcal::client
