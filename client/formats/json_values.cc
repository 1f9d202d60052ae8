#include "client/formats/json_values.h"

#include <fmt/format.h>

#include <cmath>

#include "client/formats/format_error.h"

namespace selfcal::client {
namespace {

using Json = nlohmann::ordered_json;

double Number(const Json& value, const std::string& key) {
  if (value.is_number() && std::isfinite(value.get<double>())) {
    return value.get<double>();
  }
  throw FormatError(fmt::format("field '{}' is not a number", key));
}

}  // namespace

Json ParseJson(const std::string& text) {
  try {
    return Json::parse(text);
  } catch (const Json::exception& error) {
    throw FormatError(error.what());
  }
}

const Json& JsonMember(const Json& node, const std::string& key) {
  if (node.is_object() && node.contains(key)) return node.at(key);
  throw FormatError(fmt::format("field '{}' is missing", key));
}

const Json& JsonList(const Json& node, const std::string& key) {
  const Json& list = JsonMember(node, key);
  if (list.is_array()) return list;
  throw FormatError(fmt::format("field '{}' is not a list", key));
}

double JsonNumber(const Json& node, const std::string& key) {
  return Number(JsonMember(node, key), key);
}

double JsonNumber(const Json& node, const std::string& key, double absent) {
  return node.contains(key) ? JsonNumber(node, key) : absent;
}

std::vector<double> JsonNumbers(const Json& node,
                                const std::string& key,
                                std::size_t count) {
  std::vector<double> values;
  for (const Json& value : JsonList(node, key)) {
    values.push_back(Number(value, key));
  }
  if (values.size() == count) return values;
  throw FormatError(fmt::format(
      "field '{}' needs {} numbers, not {}", key, count, values.size()));
}

}  // namespace selfcal::client
