// Assumptions of a hub on the records that a device reports, beyond that they
// can be read. The messages of a device are not those of this program: a matrix
// of another size than its calibration would be read beyond its end.
//
// Each returns INVALID_ARGUMENT that says what is wrong, unless stated
// otherwise.
#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <string>

#include "core/information/segment_information.h"
#include "core/model/calibration.h"
#include "core/model/segment.h"
#include "server/store/store.h"

namespace selfcal::server {

// `factory` is the factory calibration of the rig: all calibrations have its
// shape, and all of their numbers are finite.
absl::Status CheckReported(const StoredCalibration& calibration,
                           const Calibration& factory);
absl::Status CheckReported(const SegmentInformation& information,
                           const Calibration& factory);

// Applies the rules for segments that are sent to this program. DATA_LOSS about
// `what` if it breaks one: a report is not refused for the data of a segment,
// which is only unpacked where it is read.
absl::Status CheckReported(const MotionSegment& segment,
                           const std::string& what,
                           const Calibration& factory);

// Times in records are since the Unix epoch [ns], and not negative.
absl::Status CheckReportedTime(std::int64_t time_ns);

}  // namespace selfcal::server
