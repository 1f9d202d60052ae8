// Which rigs a list shows, and in which order.
#pragma once

#include <map>
#include <string>

namespace selfcal::server {

struct RigQuery {
  std::string text;  // that the name contains; empty: every rig
  std::map<std::string, std::string> labels;  // that it has, with these values
  enum class Order { kName, kLastSeen } order = Order::kName;
  bool descending = false;
};

}  // namespace selfcal::server
