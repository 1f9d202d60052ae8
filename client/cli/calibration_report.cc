#include "client/cli/calibration_report.h"

#include <fmt/format.h>

#include "client/text/text.h"

namespace selfcal::client {
namespace {

void AddProvenance(const v1::Calibration::Provenance& provenance,
                   Facts* facts) {
  facts->Add("recalibration", LastPart(provenance.recalibration()));
  facts->Add("started from",
             fmt::format("version {}", provenance.base_version()));
  std::string segments;
  for (const std::string& segment : provenance.segments()) {
    segments += (segments.empty() ? "" : " ") + LastPart(segment);
  }
  facts->Add("segments", segments);
  if (provenance.has_temperature()) {
    const auto& temperature = provenance.temperature();
    facts->Add("temperature",
               fmt::format("{:.1f} C, {:.1f} to {:.1f} C ({} of {} segments)",
                           temperature.mean_c(),
                           temperature.min_c(),
                           temperature.max_c(),
                           temperature.segments(),
                           provenance.segments_size()));
  }
  facts->Add("program", provenance.program_version());
  std::string settings;
  for (const auto& setting : provenance.settings()) {
    settings +=
        (settings.empty() ? "" : ", ") + setting.name() + " " + setting.value();
  }
  if (!settings.empty()) facts->Add("settings", settings);
}

void AddValidation(const v1::Validation& validation, Facts* facts) {
  for (const auto& check : validation.checks()) {
    facts->Add("check",
               fmt::format("{} {}: {:.3g}, limit {:.3g}",
                           check.name(),
                           check.passed() ? "passed" : "failed",
                           check.value(),
                           check.limit()));
  }
  const auto& held_out = validation.held_out();
  if (held_out.degrees() == 0) {
    facts->Add("held-out segments",
               fmt::format("none could be tested of {}",
                           held_out.segments() + held_out.left_out()));
    return;
  }
  facts->Add("held-out segments",
             fmt::format("{} ({} left out), {} degrees: chi-square {:.1f}, of "
                         "version {} {:.1f}",
                         held_out.segments(),
                         held_out.left_out(),
                         held_out.degrees(),
                         held_out.chi_square(),
                         validation.active_version(),
                         held_out.active_chi_square()));
}

std::string NoiseName(const std::string& kind) {
  if (kind == "pixel") return "pixel sigma";
  if (kind == "gyro") return "gyro noise";
  if (kind == "accel") return "accel noise";
  if (kind == "gyro_bias_walk") return "gyro bias walk";
  if (kind == "accel_bias_walk") return "accel bias walk";
  return kind;
}

std::string NoiseText(const v1::NoiseFactor& factor) {
  const std::string name = NoiseName(factor.kind());
  return factor.determined()
             ? fmt::format(
                   "{}: residuals suggest {:.2f} times what the rig "
                   "states (+- {:.0f} %)",
                   name,
                   factor.factor(),
                   100 * factor.log_sigma())
             : fmt::format("{}: residuals do not determine it", name);
}

void AddSolver(const v1::SolverReport& solver, Facts* facts) {
  facts->Add("solver",
             solver.message().empty()
                 ? solver.status()
                 : solver.status() + ": " + solver.message());
  facts->Add("iterations",
             fmt::format("{} in {:.1f} s, cost {:.6g} -> {:.6g}",
                         solver.iterations(),
                         solver.seconds(),
                         solver.initial_cost(),
                         solver.final_cost()));
  facts->Add("reprojection",
             fmt::format("median {:.3f} -> {:.3f} px, rms {:.3f} -> {:.3f} px",
                         solver.reprojection_median_before_px(),
                         solver.reprojection_median_after_px(),
                         solver.reprojection_rms_before_px(),
                         solver.reprojection_rms_after_px()));
  facts->Add("problem",
             fmt::format("{} segments, {} partitions, {} keyframes, {} "
                         "landmarks ({} dropped), {} observations ({} dropped)",
                         solver.segments(),
                         solver.partitions(),
                         solver.keyframes(),
                         solver.landmarks(),
                         solver.landmarks_dropped(),
                         solver.observations(),
                         solver.observations_dropped()));
  if (solver.track_noise_factor() > 1) {
    facts->Add("pixel errors along tracks",
               fmt::format("count as {:.2f} times the rig's sigma",
                           solver.track_noise_factor()));
  }
  facts->Add("observed directions",
             fmt::format("{} of {}", solver.rank(), solver.components()));
  for (const auto& direction : solver.held_constant()) {
    facts->Add("held constant", DirectionText(direction));
  }
  for (const auto& factor : solver.noise_factors()) {
    facts->Add("noise", NoiseText(factor));
  }
}

}  // namespace

Facts DescribeCalibration(const v1::Calibration& calibration) {
  Facts facts;
  facts.Add("version", fmt::format("{}", calibration.version()));
  facts.Add("state", StateText(calibration.state()));
  facts.Add("created", TimeText(calibration.create_time()));
  for (const std::string& reason : calibration.reasons()) {
    facts.Add("rejected because", reason);
  }
  if (calibration.has_provenance()) {
    AddProvenance(calibration.provenance(), &facts);
  } else {
    facts.Add("origin", "factory");
  }
  if (calibration.has_validation()) {
    AddValidation(calibration.validation(), &facts);
  }
  if (calibration.has_solver()) AddSolver(calibration.solver(), &facts);
  return facts;
}

Table CalibrationValues(const v1::Calibration& calibration) {
  Table table({{"component"}, {"value", true}, {"unit"}, {"sigma", true}});
  for (const v1::ComponentEstimate& estimate : calibration.estimates()) {
    table.Add({estimate.component(),
               ValueText(estimate.value(), estimate.sigma()),
               estimate.unit(),
               SigmaText(estimate.sigma())});
  }
  return table;
}

Facts DescribeDifferences(const v1::CompareCalibrationsResponse& differences) {
  Facts facts;
  facts.Add("versions",
            fmt::format(
                "{} and {}", differences.version_a(), differences.version_b()));
  facts.Add("shared segments",
            fmt::format("{} ({} taken into account)",
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
    table.Add({one.component(),
               ValueText(one.value_a(), one.sigma()),
               ValueText(one.value_b(), one.sigma()),
               one.unit(),
               ValueText(one.difference(), one.sigma()),
               SigmaText(one.sigma())});
  }
  return table;
}

std::string OriginText(const v1::Calibration& calibration) {
  if (!calibration.has_provenance()) return "factory";
  const v1::SolverReport& solver = calibration.solver();
  return fmt::format("{}, {} segments, rms {:.3f} -> {:.3f} px",
                     solver.status(),
                     solver.segments(),
                     solver.reprojection_rms_before_px(),
                     solver.reprojection_rms_after_px());
}

std::string CalibrationLine(const v1::Calibration& calibration) {
  return fmt::format("{}\t{}\t{}\t{}",
                     calibration.version(),
                     StateText(calibration.state()),
                     TimeText(calibration.create_time()),
                     OriginText(calibration));
}

}  // namespace selfcal::client
