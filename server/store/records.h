// Between the values of the store and the bytes of its blobs
// (proto/selfcal/store/records.proto). Doubles come back as they were, to the bit.
//
// The parsing functions return DATA_LOSS for bytes that are not what they
// should be, naming `what`.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>
#include <string_view>

#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "server/store/store.h"

namespace selfcal::server {

// All of it but create_time_ns.
std::string SerializeRig(const StoredRig& rig);
absl::StatusOr<StoredRig> ParseRig(std::string_view bytes,
                                   const std::string& what);

std::string SerializeInformation(const SegmentInformation& information);
absl::StatusOr<SegmentInformation> ParseInformation(std::string_view bytes,
                                                    const std::string& what);

// All of it but state, create_time_ns, run and segments, which are columns, and
// but what a candidate was judged by.
std::string SerializeCalibration(const StoredCalibration& calibration);
absl::StatusOr<StoredCalibration> ParseCalibration(std::string_view bytes,
                                                   const std::string& what);

// Reasons and validation of a candidate that was judged.
std::string SerializeValidation(const StoredCalibration& judged);
absl::Status ParseValidation(std::string_view bytes,
                             const std::string& what,
                             StoredCalibration* calibration);

}  // namespace selfcal::server
