#include "client/report/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "client/report/html.h"

namespace selfcal::client {
namespace {

struct Box {
  double left, top, width, height;
};

// Maps values to coordinates in a box; a single value is put in the middle.
class Scale {
 public:
  Scale(const std::vector<ChartPoint>& points, const Box& box) : box_(box) {
    x_[0] = x_[1] = points.front().x;
    y_[0] = y_[1] = points.front().y;
    for (const ChartPoint& point : points) {
      x_[0] = std::min(x_[0], point.x);
      x_[1] = std::max(x_[1], point.x);
      y_[0] = std::min(y_[0], point.y - point.sigma);
      y_[1] = std::max(y_[1], point.y + point.sigma);
    }
  }
  double X(double x) const {
    return box_.left + box_.width * Fraction(x, x_[0], x_[1]);
  }
  double Y(double y) const {
    return box_.top + box_.height * (1 - Fraction(y, y_[0], y_[1]));
  }
  double least() const { return y_[0]; }
  double most() const { return y_[1]; }

 private:
  static double Fraction(double value, double least, double most) {
    return most > least ? (value - least) / (most - least) : 0.5;
  }
  const Box box_;
  double x_[2];
  double y_[2];
};

std::vector<ChartPoint> Finite(const std::vector<ChartPoint>& points) {
  std::vector<ChartPoint> finite;
  for (const ChartPoint& point : points) {
    if (!std::isfinite(point.x) || !std::isfinite(point.y)) continue;
    finite.push_back(point);
    if (!std::isfinite(point.sigma)) finite.back().sigma = 0;
  }
  return finite;
}

}  // namespace

std::string PointChart(const std::vector<ChartPoint>& all,
                       const std::string& name,
                       const std::string& x_label,
                       const std::string& y_label) {
  const auto points = Finite(all);
  if (points.empty()) return "";
  const Box box{60, 24, 620, 116};
  const Scale scale(points, box);
  std::string marks;
  for (const ChartPoint& point : points) {
    marks += fmt::format(
        "<circle class=\"{}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\"><title>{}"
        "</title></circle>",
        point.marked ? "mark" : "hollow",
        scale.X(point.x),
        scale.Y(point.y),
        Escaped(point.title));
  }
  return fmt::format(
      "<svg role=\"img\" aria-label=\"{}\" viewBox=\"0 0 700 170\" "
      "width=\"700\" height=\"170\">"
      "<path class=\"axis\" d=\"M60 24V140H680\"/>"
      "<text x=\"55\" y=\"28\" text-anchor=\"end\">{:.3g}</text>"
      "<text x=\"55\" y=\"140\" text-anchor=\"end\">{:.3g}</text>"
      "<text x=\"680\" y=\"158\" text-anchor=\"end\">{}</text>"
      "<text x=\"60\" y=\"12\">{}</text>{}</svg>\n",
      Escaped(name),
      scale.most(),
      scale.least(),
      Escaped(x_label),
      Escaped(y_label),
      marks);
}

std::string Sparkline(const std::vector<ChartPoint>& all,
                      const std::string& name) {
  const auto points = Finite(all);
  if (points.empty()) return "";
  const Scale scale(points, {2, 3, 116, 22});
  std::string trace;
  std::string upper;
  std::string lower;
  for (const ChartPoint& point : points) {
    const double x = scale.X(point.x);
    trace += fmt::format(
        "{}{:.1f} {:.1f}", trace.empty() ? "M" : "L", x, scale.Y(point.y));
    upper += fmt::format("{}{:.1f} {:.1f}",
                         upper.empty() ? "M" : "L",
                         x,
                         scale.Y(point.y + point.sigma));
    lower = fmt::format("L{:.1f} {:.1f}", x, scale.Y(point.y - point.sigma)) +
            lower;
  }
  const ChartPoint& last = points.back();
  return fmt::format(
      "<svg role=\"img\" aria-label=\"{}\" viewBox=\"0 0 120 28\" "
      "width=\"120\" height=\"28\"><path class=\"band\" d=\"{}{}Z\"/>"
      "<path class=\"trace\" d=\"{}\"/>"
      "<circle class=\"mark\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\"/></svg>",
      Escaped(name),
      upper,
      lower,
      trace,
      scale.X(last.x),
      scale.Y(last.y));
}

std::string Bar(double fraction, const std::string& name) {
  const double width =
      std::isfinite(fraction) ? 118 * std::clamp(fraction, 0.0, 1.0) : 0.0;
  return fmt::format(
      "<svg role=\"img\" aria-label=\"{}\" viewBox=\"0 0 120 12\" "
      "width=\"120\" height=\"12\"><rect class=\"axis\" x=\"1\" y=\"1\" "
      "width=\"118\" height=\"10\"/><rect class=\"mark\" x=\"1\" y=\"1\" "
      "width=\"{:.1f}\" height=\"10\"/></svg>",
      Escaped(name),
      width);
}

}  // namespace selfcal::client
