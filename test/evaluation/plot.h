// A plot as data: what plot.py turns into an SVG.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace selfcal {

enum class SeriesStyle {
  kLine,
  kSteps,
  kScatter,
  kBars,       // y at the categories of the plot; several series side by side
  kHistogram,  // of the values x, in `bins` bins over all series of the plot
};

struct Series {
  std::string label = "";  // empty: not in the legend
  SeriesStyle style = SeriesStyle::kLine;
  std::vector<double> x = {};  // not for bars
  std::vector<double> y = {};  // not for histograms
  // A band around a line or steps, error bars of points and bars; both or none.
  std::vector<double> low = {};
  std::vector<double> high = {};
  bool dashed = false;
};

struct Plot {
  std::string title = "";
  std::string x_label = "";
  std::string y_label = "";
  bool log_x = false;
  bool log_y = false;
  std::vector<std::string> categories = {};  // of bars
  int bins = 30;                             // of histograms
  std::vector<double> horizontal = {};       // lines, for bounds
  std::vector<Series> series = {};
};

// JSON text. Throws std::invalid_argument for values that are not finite and
// lengths that do not fit.
std::string Describe(const Plot& plot);

}  // namespace selfcal
