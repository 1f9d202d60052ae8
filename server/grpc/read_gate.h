// Admits reads of messages whose size nobody knows until they are there: gRPC
// receives a message whole once its read has begun. A read reserves as much as
// the stream's last message had or, on a new stream, as a message may have; the
// first read of a stream comes before the later ones of those with large
// messages. Any thread may call.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>

#include "server/grpc/memory_pool.h"

namespace selfcal::server {

class ReadGate {
 public:
  // Interval at which a read in progress is to be checked.
  static constexpr std::chrono::milliseconds kLook{30};

  // A reservation for one read.
  class Admission {
   public:
    Admission() = default;
    explicit Admission(MemoryPool::Share share);

    bool held() const { return share_.bytes() > 0; }
    // Ends it if nothing seems to arrive: an idle stream holds up nobody.
    // Otherwise it ends after kLongest, or with End.
    void Look();
    void End() { share_.Shrink(0); }

   private:
    static constexpr std::chrono::milliseconds kLongest{2000};

    MemoryPool::Share share_;
    std::chrono::steady_clock::time_point start_;
    std::int64_t heap_ = 0;  // of the process at the start
  };

  // `message_bytes` is the limit of a message.
  ReadGate(std::int64_t bytes, std::int64_t message_bytes)
      : message_bytes_(message_bytes), pool_(bytes) {}

  // Waits until a read may begin; nullopt once `cancelled` returns true.
  // `last_bytes` is the size of the stream's last message; 0: it is new.
  std::optional<Admission> Enter(std::int64_t last_bytes,
                                 const std::function<bool()>& cancelled);

 private:
  const std::int64_t message_bytes_;
  MemoryPool pool_;
};

}  // namespace selfcal::server
