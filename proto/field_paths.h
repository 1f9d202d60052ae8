// Conversion of the path of a field of a core/model value to the path of the
// field of its message, so that the sender of the message finds the field.
#pragma once

#include <string>
#include <string_view>

namespace selfcal {

// Converts "keyframes[3].q_GI" to "keyframes[3].q_gi" and "key.session" to
// "session". Paths that are the same in both stay as they are.
std::string SegmentFieldPath(std::string_view field);

// Converts "id" to "name" and "groups[1].name" to "groups[1].group".
std::string RigFieldPath(std::string_view field);

}  // namespace selfcal
