// An update of a watch as it is sent. Watches that send the same share it, so
// that it is encoded once. Any thread may call.
#pragma once

#include <google/protobuf/message.h>

#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace selfcal::server {

class WatchUpdate {
 public:
  explicit WatchUpdate(std::unique_ptr<const google::protobuf::Message> message)
      : message_(std::move(message)) {}
  WatchUpdate(const WatchUpdate&) = delete;
  WatchUpdate& operator=(const WatchUpdate&) = delete;

  const google::protobuf::Message& message() const { return *message_; }
  // The message in protobuf's binary format; valid as long as this object.
  const std::string& bytes() const {
    std::call_once(serialised_,
                   [this] { bytes_ = message_->SerializeAsString(); });
    return bytes_;
  }

 private:
  const std::unique_ptr<const google::protobuf::Message> message_;
  mutable std::once_flag serialised_;
  mutable std::string bytes_;
};

}  // namespace selfcal::server
