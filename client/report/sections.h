// The parts of a report, each the HTML of a section.
#pragma once

#include <string>

#include "client/report/report.h"

namespace selfcal::client {

std::string VerdictSection(const ReportData& data);
// Value, sigma, sigma before, what was learned, the course over versions.
std::string ParameterSection(const ReportData& data);
// Of pixels and of the IMU, segment by segment.
std::string ResidualSection(const ReportData& data);
// Of each group over the segments, with those that a table keeps.
std::string EntropySection(const ReportData& data);
// Those that it was calibrated on.
std::string SegmentSection(const ReportData& data);
std::string OriginSection(const ReportData& data);
std::string HistorySection(const ReportData& data);

}  // namespace selfcal::client
