#include "proto/field_paths.h"

#include <algorithm>

namespace selfcal {
namespace {

// Converts to lower case: names of values have frames in capitals, names of
// message fields have no capitals.
std::string Lowered(std::string_view field) {
  std::string path(field);
  std::transform(path.begin(), path.end(), path.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return path;
}

}  // namespace

std::string SegmentFieldPath(std::string_view field) {
  constexpr std::string_view kKey = "key.";
  if (field.starts_with(kKey)) field.remove_prefix(kKey.size());
  return Lowered(field);
}

std::string RigFieldPath(std::string_view field) {
  constexpr std::string_view kName = ".name";
  if (field == "id") return "name";
  if (field.starts_with("groups[") && field.ends_with(kName)) {
    field.remove_suffix(kName.size());
    return Lowered(field) + ".group";
  }
  return Lowered(field);
}

}  // namespace selfcal
