// The path of a field of a core/model value as the path of the field of its
// message, so that who sent a message finds the field that it wrote.
#pragma once

#include <string>
#include <string_view>

namespace selfcal {

// "keyframes[3].q_GI" -> "keyframes[3].q_gi"; "key.session" -> "session".
// Paths that are the same in both stay as they are.
std::string SegmentFieldPath(std::string_view field);

// "id" -> "name"; "groups[1].name" -> "groups[1].group".
std::string RigFieldPath(std::string_view field);

}  // namespace selfcal
