#include "client/report/report.h"

#include <fmt/format.h>

#include "client/report/html.h"
#include "client/report/sections.h"
#include "client/text/text.h"

namespace selfcal::client {

std::string WriteReport(const ReportData& data) {
  return Page(fmt::format("Calibration of {}, version {}",
                          LastPart(data.rig.name()),
                          data.calibration.version()),
              VerdictSection(data) + ParameterSection(data) +
                  ResidualSection(data) + EntropySection(data) +
                  SegmentSection(data) + OriginSection(data) +
                  HistorySection(data));
}

}  // namespace selfcal::client
