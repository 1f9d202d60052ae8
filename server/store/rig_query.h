// Filter and order of a list of rigs.
#pragma once

#include <map>
#include <string>

namespace selfcal::server {

struct RigQuery {
  std::string text = {};  // part of the name; empty: every rig
  std::map<std::string, std::string> labels = {};  // which the rig must have
  // kAlarms: by how urgent they are.
  enum class Order { kName, kLastSeen, kAlarms } order = Order::kName;
  bool descending = false;
  std::string name = {};     // the whole name; empty: every rig
  bool with_alarms = false;  // only rigs that have some
};

}  // namespace selfcal::server
