// The report on a version of a calibration, written to a file.
#pragma once

#include <string>

#include "client/cli/context.h"

namespace selfcal::client {

struct ReportOptions {
  std::string rig;
  std::string version = "active";
  std::string output;
  bool force = false;  // overwrite
};

// Reads what the report shows from the daemon and writes it. Prints errors;
// returns the exit code.
int WriteReportFile(Context* context, const ReportOptions& options);

}  // namespace selfcal::client
