// Files of other tools on the disk, and what they cannot say on standard error.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

// For an option that takes the name of a format.
CLI::IsMember FormatNames();

// NOT_FOUND for one that cannot be read.
absl::StatusOr<std::vector<TextFile>> ReadTextFiles(
    const std::vector<std::string>& paths);

// A line each: "lost: NAME: what" where predictions change, otherwise "note:".
void PrintLosses(const std::vector<Loss>& losses);

// True if a prediction changes.
bool ChangesPrediction(const std::vector<Loss>& losses);

// Where the files of an export go. A single one is `output` itself, unless that
// is a folder or ends with a '/'; several go into it.
std::vector<std::string> OutputPaths(const std::vector<TextFile>& files,
                                     const std::string& output);

// All of them or, after an error, none that was not there before. Makes their
// folder. ALREADY_EXISTS for a file that is there, unless `overwrite`.
absl::Status WriteTextFiles(const std::vector<TextFile>& files,
                            const std::vector<std::string>& paths,
                            bool overwrite);

}  // namespace selfcal::client
