// Sets a timestamp of a message.
#pragma once

#include <google/protobuf/timestamp.pb.h>

#include <cstdint>

namespace selfcal::server {

// Nanoseconds of a timestamp count forward, also before 1970.
inline void SetTime(std::int64_t time_ns, google::protobuf::Timestamp* time) {
  constexpr std::int64_t kNanoseconds = 1'000'000'000;
  std::int64_t nanos = time_ns % kNanoseconds;
  if (nanos < 0) nanos += kNanoseconds;
  time->set_seconds((time_ns - nanos) / kNanoseconds);
  time->set_nanos(static_cast<std::int32_t>(nanos));
}

}  // namespace selfcal::server
