#include "test/evaluation/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace selfcal {
namespace {

using Json = nlohmann::ordered_json;

const char* Name(BoundKind kind) {
  switch (kind) {
    case BoundKind::kAtMost:
      return "at_most";
    case BoundKind::kAtLeast:
      return "at_least";
    case BoundKind::kWithin:
      return "within";
  }
  return "";
}

Json Entry(const Figure& figure, bool quick) {
  Json bound;
  switch (figure.kind) {
    case BoundKind::kAtMost:
      bound = figure.high;
      break;
    case BoundKind::kAtLeast:
      bound = figure.low;
      break;
    case BoundKind::kWithin:
      bound = {figure.low, figure.high};
      break;
  }
  return {{"name", figure.name},
          {"value", figure.value},
          {"bound", bound},
          {"holds", figure.Holds()},
          {"kind", Name(figure.kind)},
          {"unit", figure.unit},
          {"experiment", figure.experiment},
          {"quick", quick},
          {"robust", figure.robust}};
}

}  // namespace

bool Figure::Holds() const {
  const bool not_below = kind == BoundKind::kAtMost || value >= low;
  const bool not_above = kind == BoundKind::kAtLeast || value <= high;
  return not_below && not_above;
}

std::string Figure::Bound() const {
  switch (kind) {
    case BoundKind::kAtMost:
      return fmt::format("<= {:g}", high);
    case BoundKind::kAtLeast:
      return fmt::format(">= {:g}", low);
    case BoundKind::kWithin:
      return fmt::format("in [{:g}, {:g}]", low, high);
  }
  return "";
}

std::string MergeSummary(const std::string& old_text,
                         const std::vector<std::string>& experiments,
                         const std::vector<Figure>& figures,
                         bool quick) {
  Json merged = Json::array();
  if (!old_text.empty()) {
    for (const Json& entry : Json::parse(old_text)) {
      const auto experiment = entry.at("experiment").get<std::string>();
      if (std::find(experiments.begin(), experiments.end(), experiment) ==
          experiments.end()) {
        merged.push_back(entry);
      }
    }
  }
  for (const Figure& figure : figures) merged.push_back(Entry(figure, quick));
  return merged.dump(1) + "\n";
}

}  // namespace selfcal
