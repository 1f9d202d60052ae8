// Small SVG charts in the colours of the page.
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

// A chart of points over x with a y axis, for a page. `name` is its label for
// screen readers. Points that are not numbers are skipped; the result is empty
// if none is left.
std::string PointChart(const std::vector<ChartPoint>& points,
                       const std::string& name,
                       const std::string& x_label,
                       const std::string& y_label);

// A line with a band of one sigma, for a cell of a table.
std::string Sparkline(const std::vector<ChartPoint>& points,
                      const std::string& name);

// A bar that shows a fraction in [0, 1], for a cell of a table.
std::string Bar(double fraction, const std::string& name);

}  // namespace selfcal::client
