// Checks of numbers on the command line that have no upper limit. Their errors
// state the allowed range; those of CLI11 state the limits of the type, with
// hundreds of digits.
#pragma once

#include <CLI/CLI.hpp>

namespace selfcal::client {

// For counts and versions.
CLI::Validator AtLeastOne();

// For finite quantities.
CLI::Validator AboveZero();

}  // namespace selfcal::client
