// Labels of a rig as fields of its message.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/model/segment.h"
#include "selfcal/v1/rig.pb.h"

namespace selfcal::server {

// Fills *labels, or returns every violation of the rules in rig.proto.
std::vector<Violation> GetLabels(const v1::Rig& message,
                                 std::map<std::string, std::string>* labels);

}  // namespace selfcal::server
