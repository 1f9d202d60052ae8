// The data of a segment as stored in the database: a zstd frame of the message
// selfcal.v1.MotionSegment, with the checksum of the frame.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

#include "core/model/segment.h"

namespace selfcal::server {

struct Payload {
  std::string data;            // compressed
  std::int64_t raw_bytes = 0;  // before compression
  std::string sha256;          // of data
};

absl::StatusOr<Payload> PackSegment(const MotionSegment& segment);

// DATA_LOSS, naming `what`, if the data is not as it was written.
absl::StatusOr<MotionSegment> UnpackSegment(const Payload& payload,
                                            const std::string& what);

}  // namespace selfcal::server
