// A file of messages, as the containers of bags have it in common.
//
// Files are read to their end once, since the stamps of messages are in the
// messages; then single messages are read again where they were found. Nothing
// that a file claims makes it allocate more than the file contains, or than
// kMaxChunkBytes.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "client/recording/wire_reader.h"

namespace selfcal::client {

struct MessageTopic {
  std::string name;
  std::string type;  // "sensor_msgs/Image"
  Wire wire = Wire::kCdr;
};

// The name of a type without what ROS 2 adds: "sensor_msgs/Image" of
// "sensor_msgs/msg/Image".
std::string RosTypeName(std::string_view type);

// The place of a message: in a compressed chunk, or -1 for the file; the
// container knows what the offset means.
struct MessagePlace {
  std::int32_t chunk = -1;
  std::uint32_t size = 0;  // of the message
  std::uint64_t offset = 0;
};

// Not thread-safe.
class MessageFile {
 public:
  using Visitor =
      std::function<void(const MessageTopic& topic, const MessagePlace& place)>;

  virtual ~MessageFile() = default;

  // Calls visit(topic, place) for each message whose topic has a type, in the
  // order of the file; it may call Read for this message. Parts that are
  // damaged and the rest of a file that is cut off are left out, with a
  // sentence in *problems each. DATA_LOSS or UNIMPLEMENTED, with the path, if
  // there is nothing to read.
  virtual absl::Status Scan(const Visitor& visit,
                            std::vector<std::string>* problems) = 0;

  // The first `max_size` bytes of a message, or all of it if it has fewer;
  // valid until the next call. DATA_LOSS without the path.
  virtual absl::StatusOr<std::string_view> Read(const MessagePlace& place,
                                                std::size_t max_size) = 0;
};

// Opens a bag of ROS 1, an MCAP or an SQLite file of ROS 2, by its first bytes.
// INVALID_ARGUMENT with the path for another file.
absl::StatusOr<std::unique_ptr<MessageFile>> OpenMessageFile(
    const std::string& path);

}  // namespace selfcal::client
