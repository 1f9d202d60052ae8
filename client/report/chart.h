// Small pictures as SVG in the colours of the page.
#pragma once

#include <string>
#include <vector>

namespace selfcal::client {

struct ChartPoint {
  double x = 0;
  double y = 0;
  double sigma = 0;     // of y; 0: without a band
  bool marked = false;  // filled
  std::string title;    // what a pointer over it shows
};

// Points by x with an axis of y, for a page. `name` is read out in its place.
// Points that are not numbers are left out; empty where none is left.
std::string PointChart(const std::vector<ChartPoint>& points,
                       const std::string& name,
                       const std::string& x_label,
                       const std::string& y_label);

// A line with the band of one sigma, for a cell of a table.
std::string Sparkline(const std::vector<ChartPoint>& points,
                      const std::string& name);

// A bar of a fraction in [0, 1], for a cell of a table.
std::string Bar(double fraction, const std::string& name);

}  // namespace selfcal::client
