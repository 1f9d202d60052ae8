// The path of the device during a segment, in a few hundred bytes that remain
// when the data is gone.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/model/segment.h"
#include "server/store/session.h"
#include "server/store/unit_of_work.h"

namespace selfcal::server {

// Positions at evenly spread keyframes, the first and the last among them.
std::vector<PathPoint> PathOf(const MotionSegment& segment);

std::string SerializePath(const std::vector<PathPoint>& path);
// DATA_LOSS, naming `what`, for bytes that are not such a record.
absl::StatusOr<std::vector<PathPoint>> ParsePath(std::string_view bytes,
                                                 const std::string& what);

absl::Status InsertPath(UnitOfWork* tx,
                        std::int64_t sequence,
                        const std::vector<PathPoint>& path);

}  // namespace selfcal::server
