#include "client/report/sections.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "client/report/chart.h"
#include "client/report/html.h"
#include "client/text/calibration_facts.h"
#include "client/text/estimate_text.h"
#include "client/text/text.h"

namespace selfcal::client {
namespace {

const v1::Calibration& Factory(const ReportData& data) {
  for (const v1::Calibration& version : data.versions) {
    if (version.version() == 1) return version;
  }
  return v1::Calibration::default_instance();
}

std::string ClassOf(v1::Verdict::Kind kind) {
  if (kind == v1::Verdict::GOOD) return "good";
  return kind == v1::Verdict::NOT_TRUSTWORTHY ? "bad" : "weak";
}

// Sigma of the factory calibration, in the unit that is shown; 0 if the
// component is not estimated.
double SigmaBefore(const v1::Calibration& factory,
                   const std::string& component) {
  for (const auto& estimate : factory.estimates()) {
    if (estimate.component() == component) return Shown(estimate).sigma;
  }
  return 0;
}

// Returns the segments in the order of their arrival.
std::vector<const v1::Segment*> InOrder(const ReportData& data) {
  std::vector<const v1::Segment*> segments;
  for (const v1::Segment& segment : data.segments) segments.push_back(&segment);
  std::sort(segments.begin(), segments.end(), [](const auto* a, const auto* b) {
    return a->sequence() < b->sequence();
  });
  return segments;
}

std::set<std::string> UsedSegments(const v1::Calibration& calibration) {
  const auto& used = calibration.provenance().segments();
  return {used.begin(), used.end()};
}

struct Course {
  std::vector<ChartPoint> points;  // over time
  std::string unit;
};

// A component over time, from version to version.
Course CourseOf(const ReportData& data, const std::string& component) {
  Course course;
  for (const v1::Calibration& version : data.versions) {
    if (version.state() == v1::Calibration::REJECTED) continue;
    for (const auto& estimate : version.estimates()) {
      if (estimate.component() != component) continue;
      // The band of the factory calibration would dwarf all others.
      const ShownEstimate shown = Shown(estimate);
      course.unit = shown.unit;
      course.points.push_back(
          {static_cast<double>(version.create_time().seconds()),
           shown.value,
           version.version() == 1 ? 0 : shown.sigma,
           version.version() == data.calibration.version(),
           fmt::format("version {}, {} UTC: {} +- {} {}",
                       version.version(),
                       TimeText(version.create_time()),
                       ValueText(shown.value, shown.sigma),
                       SigmaText(shown.sigma),
                       shown.unit)});
    }
  }
  std::stable_sort(course.points.begin(),
                   course.points.end(),
                   [](const auto& a, const auto& b) { return a.x < b.x; });
  return course;
}

std::string Charts(const std::string& charts) {
  return "<div class=\"charts\">\n" + charts + "</div>\n";
}

}  // namespace

std::string VerdictSection(const ReportData& data) {
  const v1::Verdict& verdict = data.calibration.verdict();
  std::string sentences;
  for (const std::string& sentence : verdict.sentences()) {
    sentences += "<li>" + Escaped(sentence) + "</li>\n";
  }
  return fmt::format(
      "<div class=\"verdict {}\"><p><strong>Verdict: {}.</strong> State: {}, "
      "created {} UTC.</p>\n<ul>{}</ul></div>\n",
      ClassOf(verdict.kind()),
      Escaped(VerdictText(data.calibration)),
      Escaped(StateText(data.calibration.state())),
      Escaped(TimeText(data.calibration.create_time())),
      sentences);
}

std::string ParameterSection(const ReportData& data) {
  HtmlTable table({{"component"},
                   {"value", true},
                   {"sigma", true},
                   {"unit"},
                   {"sigma before", true},
                   {"learned [nat]", true},
                   {"learned"},
                   {"over time"}});
  for (const auto& estimate : data.calibration.estimates()) {
    const ShownEstimate shown = Shown(estimate);
    const double before = SigmaBefore(Factory(data), estimate.component());
    const double nats = std::log(before / shown.sigma);
    const bool known = before > 0 && shown.sigma > 0;
    // A full bar means that sigma is e^5 = 148 times smaller than before.
    table.Add({Escaped(estimate.component()),
               ValueText(shown.value, shown.sigma),
               SigmaText(shown.sigma),
               Escaped(shown.unit),
               SigmaText(before),
               known ? fmt::format("{:.2f}", std::max(nats, 0.0)) : "held",
               known ? Bar(nats / 5, estimate.component() + ": learned") : "",
               Sparkline(CourseOf(data, estimate.component()).points,
                         estimate.component() + " over time")});
  }
  return Section("parameters",
                 "Parameters",
                 "<p class=\"faint\">Learned is the logarithm of the ratio of "
                 "sigma before to sigma now. A component that is held "
                 "constant is not estimated.</p>\n" +
                     table.Html());
}

std::string ResidualSection(const ReportData& data) {
  std::vector<ChartPoint> pixels;
  constexpr const char* kInertial[] = {"rotation",
                                       "velocity",
                                       "position",
                                       "accelerometer bias",
                                       "gyroscope bias"};
  constexpr const char* kImus[] = {"IMU", "second IMU"};
  std::vector<ChartPoint> inertial[std::size(kImus)][std::size(kInertial)];
  const auto used = UsedSegments(data.calibration);
  for (const v1::Segment* segment : InOrder(data)) {
    if (!segment->has_residuals()) continue;
    const auto& residuals = segment->residuals();
    const auto point = [&](double value) {
      return ChartPoint{
          static_cast<double>(segment->sequence()),
          value,
          0,
          used.count(segment->name()) > 0,
          fmt::format("{}: {:.3g}", LastPart(segment->name()), value)};
    };
    pixels.push_back(point(residuals.reprojection_rms_px()));
    const auto add = [&](const auto& rms, auto* of_imu) {
      for (int k = 0;
           k < rms.size() && k < static_cast<int>(std::size(kInertial));
           ++k) {
        of_imu[k].push_back(point(rms.Get(k)));
      }
    };
    add(residuals.inertial_rms(), inertial[0]);
    add(residuals.imu1_inertial_rms(), inertial[1]);
  }
  std::string body =
      "<p class=\"faint\">Residuals of each segment when it was scored, with "
      "the calibration of that time; filled: this version was computed from it."
      "</p>\n";
  std::string charts = PointChart(pixels,
                                  "Reprojection error of each segment",
                                  "segment",
                                  "camera: root mean square [px]");
  for (std::size_t imu = 0; imu < std::size(kImus); ++imu) {
    for (std::size_t k = 0; k < std::size(kInertial); ++k) {
      const std::vector<ChartPoint>& points = inertial[imu][k];
      if (imu > 0 && points.empty()) continue;
      charts += PointChart(
          points,
          fmt::format(
              "{} residual of {} of each segment", kImus[imu], kInertial[k]),
          "segment",
          fmt::format(
              "{}, {}: root mean square [sigmas]", kImus[imu], kInertial[k]));
    }
  }
  return Section("residuals", "Residuals by sensor", body + Charts(charts));
}

std::string EntropySection(const ReportData& data) {
  std::string body =
      "<p class=\"faint\">Differential entropy of each group after one "
      "segment alone; lower is more informative. Filled: a table keeps it."
      "</p>\n";
  std::string charts;
  for (const v1::Table& table : data.tables) {
    const std::string group = LastPart(table.name());
    std::vector<ChartPoint> points;
    for (const v1::Segment* segment : InOrder(data)) {
      for (const auto& score : segment->scores()) {
        if (score.group() != group) continue;
        points.push_back({static_cast<double>(segment->sequence()),
                          score.entropy_nats(),
                          0,
                          score.in_table(),
                          fmt::format("{}: {:.2f} nat",
                                      LastPart(segment->name()),
                                      score.entropy_nats())});
      }
    }
    charts += PointChart(points,
                         "Entropy of " + group + " over the segments",
                         "segment",
                         group + " [nat]");
  }
  return Section("entropy", "Entropy over time", body + Charts(charts));
}

std::string SegmentSection(const ReportData& data) {
  const auto used = UsedSegments(data.calibration);
  HtmlTable table({{"segment"},
                   {"received"},
                   {"seconds", true},
                   {"observations", true},
                   {"reprojection rms [px]", true},
                   {"observed directions", true},
                   {"kept for"}});
  for (const v1::Segment* segment : InOrder(data)) {
    if (used.count(segment->name()) == 0) continue;
    std::string kept;
    for (const auto& score : segment->scores()) {
      if (score.in_table()) kept += (kept.empty() ? "" : ", ") + score.group();
    }
    table.Add(
        {Escaped(LastPart(segment->name())),
         TimeText(segment->receive_time()),
         fmt::format("{:.1f}",
                     1e-9 * static_cast<double>(segment->end_ns() -
                                                segment->start_ns())),
         fmt::format("{}", segment->observations()),
         fmt::format("{:.3f}", segment->residuals().reprojection_rms_px()),
         fmt::format("{} of {}", segment->rank(), segment->components()),
         kept.empty() ? "no table" : Escaped(kept)});
  }
  return Section("segments", "Segments it was computed from", table.Html());
}

std::string OriginSection(const ReportData& data) {
  const v1::Calibration& calibration = data.calibration;
  if (!calibration.has_provenance()) return "";
  HtmlTable table({{"fact"}, {""}});
  for (const Fact& fact : CalibrationFacts(calibration)) {
    table.Add({Escaped(fact.name), Escaped(fact.text)});
  }
  return Section("origin", "Origin", table.Html());
}

std::string HistorySection(const ReportData& data) {
  HtmlTable table({{"version", true},
                   {"state"},
                   {"verdict"},
                   {"made (UTC)"},
                   {"segments", true},
                   {""}});
  for (const v1::Calibration& version : data.versions) {
    table.Add({fmt::format("{}", version.version()),
               Escaped(StateText(version.state())),
               Escaped(VerdictText(version)),
               TimeText(version.create_time()),
               version.has_provenance()
                   ? fmt::format("{}", version.provenance().segments_size())
                   : "factory",
               Escaped(fmt::format("{}", fmt::join(version.reasons(), " ")))});
  }
  std::string charts;
  for (const auto& estimate : data.calibration.estimates()) {
    if (estimate.sigma() <= 0) continue;
    const Course course = CourseOf(data, estimate.component());
    charts += HistoryChart(
        course.points,
        estimate.component() + " over time",
        course.unit == "-"
            ? estimate.component()
            : fmt::format("{} [{}]", estimate.component(), course.unit));
  }
  return Section("history",
                 "History",
                 table.Html() +
                     "<details><summary>Each parameter over time, with a band "
                     "of two standard deviations</summary>\n" +
                     Charts(charts) + "</details>\n");
}

}  // namespace selfcal::client
