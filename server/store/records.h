// Conversion between the values of the store and the bytes of its blobs
// (proto/selfcal/store/records.proto). Doubles are preserved to the bit.
//
// The parsing functions return DATA_LOSS, naming `what`, for bytes that are not
// such a record.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>
#include <string_view>

#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "server/store/store.h"

namespace selfcal::server {

// Everything but create_time_ns.
std::string SerializeRig(const StoredRig& rig);
absl::StatusOr<StoredRig> ParseRig(std::string_view bytes,
                                   const std::string& what);

std::string SerializeInformation(const SegmentInformation& information);
absl::StatusOr<SegmentInformation> ParseInformation(std::string_view bytes,
                                                    const std::string& what);
// The same with the name of its segment; bytes that name another one are
// DATA_LOSS too.
std::string SerializeInformationOf(const std::string& rig,
                                   const SegmentKey& key,
                                   const SegmentInformation& information);
absl::StatusOr<SegmentInformation> ParseInformationOf(const std::string& rig,
                                                      const SegmentKey& key,
                                                      std::string_view bytes);

// Everything but state, time of creation, run and segments, which are columns,
// and the validation of a candidate.
std::string SerializeCalibration(const StoredCalibration& calibration);
absl::StatusOr<StoredCalibration> ParseCalibration(std::string_view bytes,
                                                   const std::string& what);
// The same without the iterations of the solver, which are most of the work.
absl::StatusOr<StoredCalibration> ParseWithoutSteps(std::string_view bytes,
                                                    const std::string& what);
// The same also without covariances, settings and the fits of segments.
absl::StatusOr<StoredCalibration> ParseSummary(std::string_view bytes,
                                               const std::string& what);
// Rig, version, report and seconds of the same record.
absl::StatusOr<StoredCalibration> ParseReport(std::string_view bytes,
                                              const std::string& what);

// Reasons, validation and verdict of a candidate.
std::string SerializeValidation(const StoredCalibration& validated);
absl::Status ParseValidation(std::string_view bytes,
                             const std::string& what,
                             StoredCalibration* calibration);

}  // namespace selfcal::server
