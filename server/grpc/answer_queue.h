// The answers of an exchange. They are written one at a time, in the order of
// its requests. The first one that is an error ends the exchange: neither it
// nor those after it are written. Its owner guards it by a lock. Internal to
// server/grpc.
#pragma once

#include <absl/status/status.h>
#include <grpcpp/support/byte_buffer.h>

#include <cstddef>
#include <deque>
#include <memory>

#include "server/grpc/memory_pool.h"

namespace selfcal::server {

class AnswerQueue {
 public:
  struct Answer {
    // Swaps the bytes in, none for an error, and returns the memory for the
    // work.
    void Fill(const absl::Status& result, grpc::ByteBuffer* bytes);

    bool filled = false;
    MemoryPool::Share work;  // until it is filled
    absl::Status status;
    grpc::ByteBuffer response;
  };

  // Adds the answer to the next request. It stays in place until it has been
  // written.
  Answer* Add();
  std::size_t size() const { return answers_.size(); }
  bool AllFilled() const;

  // Returns the first answer, which is being written until EndWrite. Null if
  // one is being written, if the first is not filled yet, or if it is an error,
  // which `error` then returns.
  const grpc::ByteBuffer* BeginWrite();
  // Removes the answer that was written.
  void EndWrite();
  bool writing() const { return writing_; }
  // OK until an answer that is an error was to be written.
  const absl::Status& error() const { return error_; }

 private:
  std::deque<std::unique_ptr<Answer>> answers_;
  bool writing_ = false;
  absl::Status error_;
};

}  // namespace selfcal::server
