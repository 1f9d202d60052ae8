// Small segments of one session, and their keys.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/selfcal/encoded_segment.h"
#include "core/model/segment.h"

namespace selfcal::client {

// Takes about 6 kB as a message.
inline MotionSegment Segment(std::int64_t index,
                             const std::string& session = "walk") {
  MotionSegment segment;
  segment.key = {session, index};
  segment.keyframes.resize(3);
  for (std::size_t k = 0; k < 3; ++k) {
    segment.keyframes[k].t_ns = static_cast<std::int64_t>(k);
  }
  segment.imu.resize(100);
  return segment;
}

// The segment with this number, as the queue holds it.
inline EncodedSegment Encoded(std::uint64_t number, bool on_disk = false) {
  const auto index = static_cast<std::int64_t>(number);
  auto request = std::make_shared<v1::StreamSegmentsRequest>();
  request->set_parent("rigs/device");
  request->mutable_segment()->set_session("walk");
  request->mutable_segment()->set_index(index);
  return {number, {"walk", index}, std::move(request), on_disk};
}

inline SegmentKey KeyOf(const v1::StreamSegmentsRequest& request) {
  return {request.segment().session(), request.segment().index()};
}

// Keys of the segments from begin to before end.
inline std::vector<SegmentKey> Keys(std::int64_t begin, std::int64_t end) {
  std::vector<SegmentKey> keys;
  for (std::int64_t i = begin; i < end; ++i) keys.push_back({"walk", i});
  return keys;
}

}  // namespace selfcal::client
