#include "client/report/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "client/report/html.h"
#include "client/report/ticks.h"

namespace selfcal::client {
namespace {

constexpr double kBand = 2;  // half width of a band, in sigmas
constexpr int kXTicks = 8;
constexpr int kYTicks = 5;

struct Box {
  double left, top, width, height;
  double right() const { return left + width; }
  double bottom() const { return top + height; }
};

// Of a chart with axes; the picture around it has room for labels.
constexpr Box kChart{60, 24, 620, 116};
constexpr Box kAround{-30, 0, 750, 190};
constexpr Box kCell{0, 0, 120, 28};
constexpr Box kBarCell{0, 0, 120, 12};

// Maps values to coordinates in a box; a single value is put in the middle.
class Scale {
 public:
  Scale(const std::vector<ChartPoint>& points, const Box& box) : box_(box) {
    x_[0] = x_[1] = points.front().x;
    y_[0] = y_[1] = points.front().y;
    for (const ChartPoint& point : points) {
      x_[0] = std::min(x_[0], point.x);
      x_[1] = std::max(x_[1], point.x);
      y_[0] = std::min(y_[0], point.y - kBand * point.sigma);
      y_[1] = std::max(y_[1], point.y + kBand * point.sigma);
    }
  }
  double X(double x) const {
    return box_.left + box_.width * Fraction(x, x_[0], x_[1]);
  }
  double Y(double y) const {
    return box_.top + box_.height * (1 - Fraction(y, y_[0], y_[1]));
  }
  std::vector<Tick> NumbersOfX() const {
    return NumberTicks(x_[0], x_[1], kXTicks, 1);
  }
  std::vector<Tick> TimesOfX() const {
    return TimeTicks(x_[0], x_[1], kXTicks);
  }
  std::vector<Tick> NumbersOfY() const {
    return NumberTicks(y_[0], y_[1], kYTicks);
  }

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

// Grid, ticks, their labels and those of the axes.
std::string Axes(const Scale& scale,
                 const std::vector<Tick>& x_ticks,
                 const std::string& x_label,
                 const std::string& y_label) {
  std::string axes;
  for (const Tick& tick : x_ticks) {
    const double x = scale.X(tick.value);
    axes += fmt::format(
        "<path class=\"grid\" d=\"M{0:.1f} {1:.0f}V{2:.0f}\"/>"
        "<path class=\"tick\" d=\"M{0:.1f} {2:.0f}v6\"/>"
        "<text x=\"{0:.1f}\" y=\"{3:.0f}\" text-anchor=\"middle\">{4}</text>",
        x,
        kChart.top,
        kChart.bottom(),
        kChart.bottom() + 18,
        tick.label);
    if (tick.date.empty()) continue;
    axes += fmt::format(
        "<text x=\"{:.1f}\" y=\"{:.0f}\" text-anchor=\"middle\">{}</text>",
        x,
        kChart.bottom() + 31,
        tick.date);
  }
  for (const Tick& tick : scale.NumbersOfY()) {
    axes += fmt::format(
        "<path class=\"grid\" d=\"M{1:.0f} {0:.1f}H{2:.0f}\"/>"
        "<path class=\"tick\" d=\"M{1:.0f} {0:.1f}h-6\"/>"
        "<text x=\"{3:.0f}\" y=\"{4:.1f}\" text-anchor=\"end\">{5}</text>",
        scale.Y(tick.value),
        kChart.left,
        kChart.right(),
        kChart.left - 9,
        scale.Y(tick.value) + 4,
        tick.label);
  }
  return axes + fmt::format(
                    "<text x=\"{:.0f}\" y=\"{:.0f}\" "
                    "text-anchor=\"end\">{}</text>"
                    "<text x=\"{:.0f}\" y=\"12\">{}</text>",
                    kChart.right(),
                    kAround.bottom() - 4,
                    Escaped(x_label),
                    kAround.left,
                    Escaped(y_label));
}

std::string Marks(const Scale& scale, const std::vector<ChartPoint>& points) {
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
  return marks;
}

// The line through the points, over its band.
std::string Trace(const Scale& scale, const std::vector<ChartPoint>& points) {
  std::string trace;
  std::string upper;
  std::string lower;
  for (const ChartPoint& point : points) {
    const double x = scale.X(point.x);
    const char* const command = trace.empty() ? "M" : "L";
    trace += fmt::format("{}{:.1f} {:.1f}", command, x, scale.Y(point.y));
    upper += fmt::format(
        "{}{:.1f} {:.1f}", command, x, scale.Y(point.y + kBand * point.sigma));
    lower = fmt::format(
                "L{:.1f} {:.1f}", x, scale.Y(point.y - kBand * point.sigma)) +
            lower;
  }
  return fmt::format(
      "<path class=\"band\" d=\"{}{}Z\"/><path class=\"trace\" d=\"{}\"/>",
      upper,
      lower,
      trace);
}

std::string Picture(const std::string& name,
                    const Box& box,
                    const std::string& content) {
  return fmt::format(
      "<svg role=\"img\" aria-label=\"{0}\" viewBox=\"{1:.0f} {2:.0f} {3:.0f} "
      "{4:.0f}\" width=\"{3:.0f}\" height=\"{4:.0f}\">{5}</svg>",
      Escaped(name),
      box.left,
      box.top,
      box.width,
      box.height,
      content);
}

}  // namespace

std::string PointChart(const std::vector<ChartPoint>& all,
                       const std::string& name,
                       const std::string& x_label,
                       const std::string& y_label) {
  const auto points = Finite(all);
  if (points.empty()) return "";
  const Scale scale(points, kChart);
  return Picture(name,
                 kAround,
                 Axes(scale, scale.NumbersOfX(), x_label, y_label) +
                     Marks(scale, points)) +
         "\n";
}

std::string HistoryChart(const std::vector<ChartPoint>& all,
                         const std::string& name,
                         const std::string& y_label) {
  const auto points = Finite(all);
  if (points.empty()) return "";
  const Scale scale(points, kChart);
  return Picture(name,
                 kAround,
                 Axes(scale, scale.TimesOfX(), "time (UTC)", y_label) +
                     Trace(scale, points) + Marks(scale, points)) +
         "\n";
}

std::string Sparkline(const std::vector<ChartPoint>& all,
                      const std::string& name) {
  const auto points = Finite(all);
  if (points.empty()) return "";
  const Scale scale(points, {2, 3, 116, 22});
  const ChartPoint& last = points.back();
  return Picture(
      name,
      kCell,
      Trace(scale, points) +
          fmt::format(
              "<circle class=\"mark\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\"/>",
              scale.X(last.x),
              scale.Y(last.y)));
}

std::string Bar(double fraction, const std::string& name) {
  const double width =
      std::isfinite(fraction) ? 118 * std::clamp(fraction, 0.0, 1.0) : 0.0;
  return Picture(
      name,
      kBarCell,
      fmt::format("<rect class=\"axis\" x=\"1\" y=\"1\" width=\"118\" "
                  "height=\"10\"/><rect class=\"mark\" x=\"1\" y=\"1\" "
                  "width=\"{:.1f}\" height=\"10\"/>",
                  width));
}

}  // namespace selfcal::client
