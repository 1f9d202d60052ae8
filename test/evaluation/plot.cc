#include "test/evaluation/plot.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace selfcal {
namespace {

const char* Name(SeriesStyle style) {
  switch (style) {
    case SeriesStyle::kLine:
      return "line";
    case SeriesStyle::kSteps:
      return "steps";
    case SeriesStyle::kScatter:
      return "scatter";
    case SeriesStyle::kBars:
      return "bars";
    case SeriesStyle::kHistogram:
      return "histogram";
  }
  return "";
}

void CheckSeries(const Plot& plot, const Series& series) {
  for (const auto* values : {&series.x, &series.y, &series.low, &series.high}) {
    for (const double value : *values) {
      if (!std::isfinite(value)) {
        throw std::invalid_argument("plot: a value of '" + series.label +
                                    "' is not finite");
      }
    }
  }
  const bool histogram = series.style == SeriesStyle::kHistogram;
  const std::size_t size = series.style == SeriesStyle::kBars
                               ? plot.categories.size()
                               : series.x.size();
  const bool fits = (histogram ? series.y.empty() : series.y.size() == size) &&
                    (series.low.empty() || series.low.size() == size) &&
                    series.low.size() == series.high.size();
  if (!fits) {
    throw std::invalid_argument("plot: lengths of '" + series.label +
                                "' differ");
  }
}

}  // namespace

std::string Describe(const Plot& plot) {
  nlohmann::ordered_json json = {{"title", plot.title},
                                 {"x_label", plot.x_label},
                                 {"y_label", plot.y_label},
                                 {"log_x", plot.log_x},
                                 {"log_y", plot.log_y},
                                 {"categories", plot.categories},
                                 {"bins", plot.bins},
                                 {"horizontal", plot.horizontal},
                                 {"series", nlohmann::json::array()}};
  for (const Series& series : plot.series) {
    CheckSeries(plot, series);
    json["series"].push_back({{"label", series.label},
                              {"style", Name(series.style)},
                              {"x", series.x},
                              {"y", series.y},
                              {"low", series.low},
                              {"high", series.high},
                              {"dashed", series.dashed}});
  }
  return json.dump(1) + "\n";
}

}  // namespace selfcal
