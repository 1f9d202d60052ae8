#include "client/text/calibration_facts.h"

#include <fmt/format.h>

#include <string_view>
#include <utility>

#include "client/text/estimate_text.h"
#include "client/text/text.h"

namespace selfcal::client {
namespace {

using FactList = std::vector<Fact>;

// Probability below which a device change is not shown.
constexpr double kMinShownProbability = 0.1;

void Add(FactList* facts, std::string name, std::string text) {
  facts->push_back({std::move(name), std::move(text)});
}

void AddProvenance(const v1::Calibration::Provenance& provenance,
                   FactList* facts) {
  Add(facts, "recalibration", LastPart(provenance.recalibration()));
  Add(facts,
      "started from",
      fmt::format("version {}", provenance.base_version()));
  std::string segments;
  for (const std::string& segment : provenance.segments()) {
    segments += (segments.empty() ? "" : " ") + LastPart(segment);
  }
  Add(facts, "segments", segments);
  if (provenance.has_temperature()) {
    const auto& temperature = provenance.temperature();
    Add(facts,
        "temperature",
        fmt::format("{:.1f} C, {:.1f} to {:.1f} C ({} of {})",
                    temperature.mean_c(),
                    temperature.min_c(),
                    temperature.max_c(),
                    temperature.segments(),
                    CountText(provenance.segments_size(), "segment")));
  }
  Add(facts, "program", provenance.program_version());
  std::string settings;
  for (const auto& setting : provenance.settings()) {
    settings +=
        (settings.empty() ? "" : ", ") + setting.name() + " " + setting.value();
  }
  if (!settings.empty()) Add(facts, "settings", settings);
}

void AddVerdict(const v1::Calibration& calibration, FactList* facts) {
  Add(facts, "verdict", VerdictText(calibration));
  const auto& verdict = calibration.verdict();
  // The reasons of a rejection are listed as such.
  if (verdict.kind() == v1::Verdict::NOT_TRUSTWORTHY &&
      calibration.reasons_size() > 0) {
    return;
  }
  const bool is_note = verdict.kind() == v1::Verdict::GOOD ||
                       verdict.kind() == v1::Verdict::FACTORY ||
                       verdict.kind() == v1::Verdict::UNKNOWN;
  const std::string name =
      is_note ? "note" : VerdictText(calibration) + " because";
  for (const std::string& sentence : verdict.sentences()) {
    Add(facts, name, sentence);
  }
}

std::string CheckText(const v1::Validation::Check& check) {
  if (check.outcome() == v1::Validation::Check::NOT_TESTED) {
    return fmt::format("{} not tested: {}", check.name(), check.sentence());
  }
  return fmt::format("{} {}: {:.3g}, limit {:.3g}",
                     check.name(),
                     check.passed() ? "passed" : "failed",
                     check.value(),
                     check.limit());
}

void AddValidation(const v1::Validation& validation, FactList* facts) {
  for (const auto& check : validation.checks()) {
    Add(facts, "check", CheckText(check));
  }
  const auto& held_out = validation.held_out();
  if (held_out.degrees() == 0) {
    Add(facts,
        "held-out segments",
        fmt::format("none could be tested of {}",
                    held_out.segments() + held_out.left_out()));
    return;
  }
  Add(facts,
      "held-out segments",
      fmt::format("{} ({} rescored, {} not testable), {} degrees: chi-square "
                  "{:.1f}, of version {} {:.1f}",
                  held_out.segments(),
                  held_out.rescored(),
                  held_out.left_out(),
                  held_out.degrees(),
                  held_out.chi_square(),
                  validation.active_version(),
                  held_out.active_chi_square()));
}

std::string NoiseName(const std::string& kind) {
  constexpr std::string_view kSecondImu = "imu1_";
  if (kind.starts_with(kSecondImu)) {
    return "second " + NoiseName(kind.substr(kSecondImu.size()));
  }
  if (kind == "pixel") return "pixel sigma";
  if (kind == "gyro") return "gyro noise";
  if (kind == "accel") return "accel noise";
  if (kind == "gyro_bias_walk") return "gyro bias walk";
  if (kind == "accel_bias_walk") return "accel bias walk";
  return kind;
}

std::string NoiseText(const v1::NoiseFactor& factor) {
  std::string text = NoiseName(factor.kind()) + ": ";
  text += factor.determined()
              ? fmt::format(
                    "residuals suggest {:.2f} times what the rig states (+- "
                    "{:.0f} %)",
                    factor.factor(),
                    100 * factor.log_sigma())
              : "residuals do not determine it";
  if (factor.used() == 0) return text;  // it was not recorded
  if (!factor.converged()) text += ", the estimate did not converge";
  return text + fmt::format("; {:.2f} times was used", factor.used());
}

void AddAgreement(const v1::SolverReport& solver, FactList* facts) {
  const v1::AgreementTest& halves = solver.halves();
  if (halves.degrees() > 0) {
    Add(facts,
        "halves of the segments",
        fmt::format("chi-square {:.1f} with {} degrees, probability {:.2g}",
                    halves.chi_square(),
                    halves.degrees(),
                    halves.probability()));
  }
  for (const v1::SegmentFit& fit : solver.segment_fits()) {
    if (fit.excluded().empty()) continue;
    Add(facts,
        "excluded segment",
        fmt::format("{}: {}", LastPart(fit.segment()), fit.excluded()));
  }
}

void AddChange(const v1::EvictedUse& use, FactList* facts) {
  if (use.change_probability() < kMinShownProbability) return;
  Add(facts,
      "device changed",
      fmt::format("among its segments with probability {:.2g}; sigmas account "
                  "for that",
                  use.change_probability()));
}

void AddEvicted(const v1::EvictedUse& use, FactList* facts) {
  if (!use.unused().empty()) {
    Add(facts, "segments without data", "not used: " + use.unused());
    return;
  }
  if (use.segments() == 0) return;
  std::string text = fmt::format(
      "{} used, linearised up to {:.2g} sigma_ref "
      "from the result",
      use.segments(),
      use.reach());
  if (use.too_far() > 0) {
    text += fmt::format("; {} linearised too far away", use.too_far());
  }
  if (use.contradicting() > 0) {
    text += fmt::format("; {} contradict the others", use.contradicting());
  }
  Add(facts, "segments without data", text);
}

void AddSolver(const v1::SolverReport& solver, FactList* facts) {
  Add(facts,
      "solver",
      solver.message().empty() ? solver.status()
                               : solver.status() + ": " + solver.message());
  Add(facts,
      "iterations",
      fmt::format("{} in {:.1f} s, cost {:.6g} -> {:.6g}",
                  solver.iterations(),
                  solver.seconds(),
                  solver.initial_cost(),
                  solver.final_cost()));
  Add(facts,
      "reprojection",
      fmt::format("median {:.3f} -> {:.3f} px, rms {:.3f} -> {:.3f} px",
                  solver.reprojection_median_before_px(),
                  solver.reprojection_median_after_px(),
                  solver.reprojection_rms_before_px(),
                  solver.reprojection_rms_after_px()));
  Add(facts,
      "problem",
      fmt::format("{}, {}, {}, {} ({} dropped), {} ({} dropped)",
                  CountText(solver.segments(), "segment"),
                  CountText(solver.partitions(), "partition"),
                  CountText(solver.keyframes(), "keyframe"),
                  CountText(solver.landmarks(), "landmark"),
                  solver.landmarks_dropped(),
                  CountText(solver.observations(), "observation"),
                  solver.observations_dropped()));
  if (solver.track_noise_factor() > 1) {
    Add(facts,
        "pixel errors along tracks",
        fmt::format("weighted with {:.2f} times the rig's sigma",
                    solver.track_noise_factor()));
  }
  Add(facts,
      "observed directions",
      fmt::format("{} of {}", solver.rank(), solver.components()));
  for (const auto& direction : solver.held_constant()) {
    Add(facts, "held constant", DirectionText(direction));
  }
  for (const auto& factor : solver.noise_factors()) {
    Add(facts, "noise", NoiseText(factor));
  }
  AddAgreement(solver, facts);
  AddEvicted(solver.evicted(), facts);
  AddChange(solver.evicted(), facts);
}

}  // namespace

std::vector<Fact> CalibrationFacts(const v1::Calibration& calibration) {
  FactList facts;
  Add(&facts, "version", fmt::format("{}", calibration.version()));
  Add(&facts, "state", StateText(calibration.state()));
  AddVerdict(calibration, &facts);
  if (calibration.has_temperature_c()) {
    Add(&facts,
        "values at",
        fmt::format("{:.1f} C{}",
                    calibration.temperature_c(),
                    calibration.parameters().has_reference_temperature_c()
                        ? ", the reference; elsewhere by the slopes"
                        : ""));
  }
  Add(&facts, "created", TimeText(calibration.create_time()));
  for (const std::string& reason : calibration.reasons()) {
    Add(&facts, "rejected because", reason);
  }
  if (calibration.has_provenance()) {
    AddProvenance(calibration.provenance(), &facts);
  } else {
    Add(&facts, "origin", "factory");
  }
  if (calibration.has_validation()) {
    AddValidation(calibration.validation(), &facts);
  }
  if (calibration.has_solver()) AddSolver(calibration.solver(), &facts);
  return facts;
}

}  // namespace selfcal::client
