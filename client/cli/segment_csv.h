// Motion segments as tables of numbers: four CSV files, which several segments
// share. Every row begins with session and index.
#pragma once

#include <array>
#include <string>

#include "selfcal/v1/segment.pb.h"

namespace selfcal::client {

struct CsvFile {
  std::string name;
  std::string header;  // with units, ends with a newline
};

// keyframes, imu, landmarks, observations.
const std::array<CsvFile, 4>& SegmentCsvFiles();

// The rows of each file. Numbers have as many digits as bring them back.
std::array<std::string, 4> SegmentCsvRows(const v1::MotionSegment& segment);

}  // namespace selfcal::client
