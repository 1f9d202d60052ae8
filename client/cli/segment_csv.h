// Motion segments as four CSV files, which several segments share. Every row
// starts with session and index.
#pragma once

#include <array>
#include <string>

#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

struct CsvFile {
  std::string name;
  std::string header;  // column names with units, and a newline
};

// The files keyframes, imu, landmarks and observations.
const std::array<CsvFile, 4>& SegmentCsvFiles();

// Returns the rows for each file. Numbers have enough digits to be read back
// exactly.
std::array<std::string, 4> SegmentCsvRows(const v1::MotionSegment& segment);

}  // namespace selfcal::client
