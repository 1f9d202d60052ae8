// Which rigs: filter and order of a list of them, or of what belongs to them.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace selfcal::server {

// The rigs that have one of the names, or one of the labels (name, value).
struct RigChoice {
  std::set<std::string> names;
  std::set<std::pair<std::string, std::string>> labels;
};

struct RigQuery {
  std::string text = {};  // part of the name; empty: every rig
  std::map<std::string, std::string> labels = {};  // which the rig must have
  // kAlarms: by how urgent they are.
  enum class Order { kName, kLastSeen, kAlarms } order = Order::kName;
  bool descending = false;
  std::string name = {};                 // the whole name; empty: every rig
  bool with_alarms = false;              // only rigs that have some
  std::optional<RigChoice> choice = {};  // nullopt: every rig
};

}  // namespace selfcal::server
