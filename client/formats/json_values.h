// Reading the values of JSON files. Every function throws FormatError, which
// names the field.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace selfcal::client {

nlohmann::ordered_json ParseJson(const std::string& text);
const nlohmann::ordered_json& JsonMember(const nlohmann::ordered_json& node,
                                         const std::string& key);
const nlohmann::ordered_json& JsonList(const nlohmann::ordered_json& node,
                                       const std::string& key);
double JsonNumber(const nlohmann::ordered_json& node, const std::string& key);
double JsonNumber(const nlohmann::ordered_json& node,
                  const std::string& key,
                  double absent);
std::vector<double> JsonNumbers(const nlohmann::ordered_json& node,
                                const std::string& key,
                                std::size_t count);

}  // namespace selfcal::client
