// Bags of ROS 1, format 2.0 (wiki.ros.org/Bags/Format/2.0), with chunks that
// are uncompressed, lz4 or bz2. Of the index at the end only the connections
// are used: bags without it, that were not closed (.bag.active), are read as
// well.
#pragma once

#include <cstdint>
#include <memory>

#include "client/recording/input_file.h"
#include "client/recording/message_file.h"

namespace selfcal::client {

// A bag whose records begin at `begin`, behind the line with the version.
std::unique_ptr<MessageFile> MakeRos1Bag(std::unique_ptr<InputFile> file,
                                         std::uint64_t begin);

}  // namespace selfcal::client
