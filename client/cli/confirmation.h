#pragma once

#include <string>

namespace selfcal::client {

// Asks on standard error, and returns whether the answer on standard input is
// yes.
bool Confirmed(const std::string& question);

}  // namespace selfcal::client
