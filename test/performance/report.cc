#include "test/performance/report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace selfcal {
namespace {

bool Reaches(const Result& result, const std::optional<double>& bound) {
  return result.what.higher_is_better ? result.measured.ratio >= *bound
                                      : result.measured.ratio <= *bound;
}

std::string Verdict(const Result& result) {
  if (!result.what.must) return "";
  if (!Reaches(result, result.what.must)) return "MISSED";
  return Reaches(result, result.what.goal) ? "goal" : "must";
}

std::string Number(const std::optional<double>& value) {
  return value ? fmt::format("{:g}", *value) : "";
}

constexpr const char* kLine = "{:<54} {:>8} {:>6} {:>6}  {:<6}  {}";

}  // namespace

std::string TableHead() {
  return fmt::format(
      fmt::runtime(kLine), "case", "ratio", "must", "goal", "", "figures");
}

std::string TableLine(const Result& result) {
  std::string figures;
  for (const auto& [name, value] : result.measured.figures) {
    figures +=
        fmt::format("{}{} {:.4g}", figures.empty() ? "" : ", ", name, value);
  }
  return fmt::format(fmt::runtime(kLine),
                     result.what.name,
                     fmt::format("{:.3g}", result.measured.ratio),
                     Number(result.what.must),
                     Number(result.what.goal),
                     Verdict(result),
                     figures);
}

void WriteJson(const std::vector<Result>& results, std::ostream& to) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Result& result : results) {
    nlohmann::ordered_json entry;
    entry["case"] = result.what.name;
    entry["ratio"] = result.measured.ratio;
    if (result.what.must) entry["must"] = *result.what.must;
    if (result.what.goal) entry["goal"] = *result.what.goal;
    if (!result.what.higher_is_better) entry["higher_is_better"] = false;
    entry["figures"] = result.measured.figures;
    list.push_back(std::move(entry));
  }
  to << list.dump(2) << "\n";
}

}  // namespace selfcal
