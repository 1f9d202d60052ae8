// A report on a calibration as one self-contained HTML file, e.g. to attach to
// a question or a release.
#pragma once

#include <string>
#include <vector>

#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

// The input of a report, as the daemon returns it.
struct ReportData {
  v1::Rig rig;
  v1::Calibration calibration;            // the subject of the report
  std::vector<v1::Calibration> versions;  // all of the rig, with the factory's
  std::vector<v1::Table> tables;
  std::vector<v1::Segment> segments;  // scored, in any order
};

// Writes the report: the verdict first, then the data behind it.
std::string WriteReport(const ReportData& data);

}  // namespace selfcal::client
