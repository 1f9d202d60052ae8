// A calibration as one HTML file that needs nothing beside it: what people
// attach to a question or a release.
#pragma once

#include <string>
#include <vector>

#include "selfcal/v1/calibration_service.pb.h"
#include "selfcal/v1/rig.pb.h"
#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

// As the daemon gives them.
struct ReportData {
  v1::Rig rig;
  v1::Calibration calibration;            // that the report is about
  std::vector<v1::Calibration> versions;  // all of the rig, the factory's too
  std::vector<v1::Table> tables;
  std::vector<v1::Segment> segments;  // scored, in any order
};

// The verdict first, then what it rests on.
std::string WriteReport(const ReportData& data);

}  // namespace selfcal::client
