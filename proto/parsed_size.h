// Memory that a message will take, from its wire format, before it is parsed.
//
// An empty message within another one, or a field that this program does not
// know, is two bytes on the wire and a hundred in memory: a message of 64 MiB
// may become gigabytes.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/zero_copy_stream.h>

#include <cstdint>

namespace selfcal {

// An upper bound [bytes] of what a generated message of this type takes that is
// parsed from this wire format, but for the slack of its allocations. Of what
// is not a message of this type, the bound holds up to where parsing fails.
std::int64_t ParsedSize(const google::protobuf::Descriptor& type,
                        google::protobuf::io::ZeroCopyInputStream* bytes);

}  // namespace selfcal
