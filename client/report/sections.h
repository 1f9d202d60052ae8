// The sections of a report, as HTML.
#pragma once

#include <string>

#include "client/report/report.h"

namespace selfcal::client {

std::string VerdictSection(const ReportData& data);
// Components: value, sigma, sigma before, what was learned, the history over
// versions.
std::string ParameterSection(const ReportData& data);
// Residuals of pixels and of the IMU, segment by segment.
std::string ResidualSection(const ReportData& data);
// Entropy of each group over the segments, with those that a table keeps.
std::string EntropySection(const ReportData& data);
// The segments that the version was computed from.
std::string SegmentSection(const ReportData& data);
std::string OriginSection(const ReportData& data);
std::string HistorySection(const ReportData& data);

}  // namespace selfcal::client
