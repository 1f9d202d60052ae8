// What the loader of each tool reads: keys, types and ranges, as the sources of
// the tools state them (docs/formats.md names these).
#pragma once

#include <string>
#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

// Compares the files that were written for a tool with the table of its loader.
// Returns a line for each key that is missing, has another type, or is not in
// the table.
std::vector<std::string> LoaderFaults(const std::string& format,
                                      const std::vector<TextFile>& files);

}  // namespace selfcal::client
