#include "client/cli/calibration_report.h"

#include <fmt/format.h>

#include <utility>

#include "client/text/calibration_facts.h"
#include "client/text/estimate_text.h"
#include "client/text/text.h"
#include "proto/safe_text.h"

namespace selfcal::client {

Facts DescribeCalibration(const v1::Calibration& calibration) {
  Facts facts;
  for (Fact& fact : CalibrationFacts(calibration)) {
    facts.Add(fact.name, std::move(fact.text));
  }
  return facts;
}

Table CalibrationValues(const v1::Calibration& calibration) {
  Table table({{"component"}, {"value", true}, {"unit"}, {"sigma", true}});
  for (const v1::ComponentEstimate& estimate : calibration.estimates()) {
    const ShownEstimate shown = Shown(estimate);
    table.Add({estimate.component(),
               ValueText(shown.value, shown.sigma),
               shown.unit,
               SigmaText(shown.sigma)});
  }
  return table;
}

Facts DescribeDifferences(const v1::CompareCalibrationsResponse& differences) {
  Facts facts;
  facts.Add("versions",
            fmt::format(
                "{} and {}", differences.version_a(), differences.version_b()));
  facts.Add("shared segments",
            fmt::format("{} ({} accounted for)",
                        differences.shared_segments(),
                        differences.shared_segments_used()));
  facts.Add(
      "difference",
      fmt::format("{}: chi-square {:.1f} with {} degrees, probability "
                  "{:.2g}",
                  differences.significant() ? "significant" : "not significant",
                  differences.chi_square(),
                  differences.degrees(),
                  differences.probability()));
  return facts;
}

Table DifferenceValues(const v1::CompareCalibrationsResponse& differences) {
  Table table({{"component"},
               {"a", true},
               {"b", true},
               {"unit"},
               {"difference", true},
               {"sigma", true}});
  for (const auto& one : differences.differences()) {
    const ShownDifference shown = Shown(one);
    table.Add({one.component(),
               ValueText(shown.a, shown.sigma),
               ValueText(shown.b, shown.sigma),
               shown.unit,
               ValueText(shown.difference, shown.sigma),
               SigmaText(shown.sigma)});
  }
  return table;
}

std::string OriginText(const v1::Calibration& calibration) {
  if (!calibration.has_provenance()) return "factory";
  const v1::SolverReport& solver = calibration.solver();
  return fmt::format("{}, {}, rms {:.3f} -> {:.3f} px",
                     solver.status(),
                     CountText(solver.segments(), "segment"),
                     solver.reprojection_rms_before_px(),
                     solver.reprojection_rms_after_px());
}

std::string CalibrationLine(const v1::Calibration& calibration) {
  return fmt::format("{}\t{}\t{}\t{}\t{}",
                     calibration.version(),
                     StateText(calibration.state()),
                     TimeText(calibration.create_time()),
                     SafeLine(OriginText(calibration)),
                     SafeLine(VerdictText(calibration)));
}

}  // namespace selfcal::client
