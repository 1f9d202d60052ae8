// Static SVG charts in the colours of the page, with the ticks and bands of the
// charts of the web console.
#pragma once

#include <string>
#include <vector>

namespace selfcal::client {

struct ChartPoint {
  double x = 0;
  double y = 0;
  double sigma = 0;     // of y; 0: draw no band
  bool marked = false;  // draw the point filled
  std::string title;    // tooltip
};

// Charts skip points that are not numbers, and are empty if none is left.
// `name` is the label for screen readers, `y_label` has the unit.

// Points over consecutive numbers, e.g. of segments.
std::string PointChart(const std::vector<ChartPoint>& points,
                       const std::string& name,
                       const std::string& x_label,
                       const std::string& y_label);

// A line over time with a band of two sigmas; x is in seconds since 1970.
std::string HistoryChart(const std::vector<ChartPoint>& points,
                         const std::string& name,
                         const std::string& y_label);

// The line and the band of a history chart, for a cell of a table.
std::string Sparkline(const std::vector<ChartPoint>& points,
                      const std::string& name);

// A bar that shows a fraction in [0, 1], for a cell of a table.
std::string Bar(double fraction, const std::string& name);

}  // namespace selfcal::client
