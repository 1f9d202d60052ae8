// Reads and writes the files of other tools, and prints what is lost in the
// conversion to standard error.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "client/formats/format.h"

namespace selfcal::client {

// Validator of an option whose value is the name of a format.
CLI::Validator FormatNames();

// Reads files, with the errors of ReadFile.
absl::StatusOr<std::vector<TextFile>> ReadTextFiles(
    const std::vector<std::string>& paths);

// Prints a line for each loss: "lost: NAME: text" if predictions change,
// otherwise "note: NAME: text".
void PrintLosses(const std::vector<Loss>& losses);

// True if a loss changes predictions.
bool ChangesPrediction(const std::vector<Loss>& losses);

// Returns the paths for the files of an export. A single file gets the path
// `output`, unless that is a folder or ends with a '/'; several files go into
// the folder `output`.
std::vector<std::string> OutputPaths(const std::vector<TextFile>& files,
                                     const std::string& output);

// Writes all files or, after an error, none that did not exist before. Creates
// the folder. ALREADY_EXISTS if a file exists, unless `overwrite` is set.
absl::Status WriteTextFiles(const std::vector<TextFile>& files,
                            const std::vector<std::string>& paths,
                            bool overwrite);

}  // namespace selfcal::client
