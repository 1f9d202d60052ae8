// Sets a timestamp of a message.
#pragma once

#include <google/protobuf/timestamp.pb.h>

#include <cstdint>

namespace selfcal::server {

inline void SetTime(std::int64_t time_ns, google::protobuf::Timestamp* time) {
  constexpr std::int64_t kNanoseconds = 1'000'000'000;
  time->set_seconds(time_ns / kNanoseconds);
  time->set_nanos(static_cast<std::int32_t>(time_ns % kNanoseconds));
}

}  // namespace selfcal::server
