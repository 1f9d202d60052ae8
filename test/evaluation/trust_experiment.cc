// Can a user rely on what is active? Devices of all kinds, honest and not, are
// driven as the daemon drives them; no active version may be further from truth
// than it claims.
//
// SELFCAL_TRUST_SEEDS=design takes the seeds that thresholds may be chosen on;
// SELFCAL_TRUST_DEVICES=KIND[/SEED][,...] runs only these.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "server/pipeline/verdict.h"
#include "test/evaluation/context.h"
#include "test/evaluation/statistics.h"
#include "test/evaluation/trust_device.h"
#include "test/evaluation/trust_kinds.h"

namespace selfcal {
namespace {

constexpr double kUnlikely = 0.01;
constexpr double kByChance = 1e-3;
constexpr double kNeesProbability = 0.95;
constexpr double kMaxFromClean = 0.3;  // sigma

// One device to run, and what came of it.
struct Trial {
  const TrustKind* kind;
  std::uint64_t seed;
  bool missing = false;  // a recording
  Rig rig = {};
  Rig sensors = {};
  TrustOutcome outcome = {};
  std::optional<TrustOutcome> clean = std::nullopt;

  std::string Name() const { return fmt::format("{}/{}", kind->name, seed); }
};

std::vector<std::string> Wanted() {
  const char* list = std::getenv("SELFCAL_TRUST_DEVICES");
  std::vector<std::string> names;
  std::stringstream stream(list == nullptr ? "" : list);
  for (std::string name; std::getline(stream, name, ',');) {
    names.push_back(name);
  }
  return names;
}

TrustSeeds SeedsToUse() {
  const char* seeds = std::getenv("SELFCAL_TRUST_SEEDS");
  if (seeds == nullptr || std::string(seeds) == "judging") {
    return TrustSeeds::kJudging;
  }
  if (std::string(seeds) == "design") return TrustSeeds::kDesign;
  throw std::invalid_argument(fmt::format(
      "SELFCAL_TRUST_SEEDS is '{}'; give judging or design", seeds));
}

std::vector<Trial> ListTrials(bool quick) {
  const std::vector<std::string> wanted = Wanted();
  const TrustSeeds seeds = SeedsToUse();
  std::vector<Trial> trials;
  for (const TrustKind& kind : TrustKinds()) {
    const int devices =
        quick && wanted.empty() ? kind.quick_devices : kind.devices;
    for (int i = 0; i < devices; ++i) {
      Trial trial{&kind, SeedOf(kind, seeds, i)};
      const bool runs =
          wanted.empty() ||
          std::any_of(wanted.begin(), wanted.end(), [&](const auto& name) {
            return name == kind.name || name == trial.Name();
          });
      if (runs) trials.push_back(std::move(trial));
    }
  }
  if (trials.empty()) {
    throw std::invalid_argument(fmt::format(
        "SELFCAL_TRUST_DEVICES={} names no device; kinds are in trust_kinds.h",
        fmt::join(wanted, ",")));
  }
  return trials;
}

bool HasActive(const Trial& trial) { return trial.outcome.final_version > 1; }

bool IsSilentFailure(const TrustVersion& version) {
  return version.became_active && version.error && IsFailure(*version.error);
}

// The worst of all that became active: a user may have used any of them.
// Nothing where none did, or truth is not known.
const TrustVersion* WorstActive(const Trial& trial) {
  const TrustVersion* worst = nullptr;
  for (const TrustVersion& version : trial.outcome.versions) {
    if (!version.became_active || !version.error) continue;
    if (worst == nullptr || version.error->nees > worst->error->nees) {
      worst = &version;
    }
  }
  return worst;
}

bool HasFailed(const Trial& trial) {
  const TrustOutcome& outcome = trial.outcome;
  return std::any_of(outcome.versions.begin(),
                     outcome.versions.end(),
                     IsSilentFailure) ||
         (outcome.final_error && IsFailure(*outcome.final_error));
}

// Largest component of the difference from the clean device's calibration, in
// the sigmas of that; nothing where one of them has none.
std::optional<double> FromClean(const Trial& trial) {
  if (!trial.clean || !HasActive(trial) || trial.clean->final_version == 1) {
    return std::nullopt;
  }
  const Eigen::VectorXd difference =
      BoxMinus(trial.outcome.final_theta, trial.clean->final_theta);
  double largest = 0;
  for (const int i : FreeComponents(trial.rig)) {
    largest = std::max(largest,
                       std::abs(difference(i)) /
                           std::sqrt(trial.clean->final_covariance(i, i)));
  }
  return largest;
}

void Run(Trial* trial, const Context& context) {
  const auto device = trial->kind->make(trial->seed);
  if (!device) {
    trial->missing = true;
    return;
  }
  trial->rig = device->rig;
  trial->sensors = device->sensors;
  try {
    trial->outcome = Drive(*device);
    if (trial->kind->clean) {
      trial->clean = Drive(*trial->kind->clean(trial->seed));
    }
  } catch (const std::exception& error) {
    throw std::runtime_error(trial->Name() + ": " + error.what());
  }
  const TrustOutcome& outcome = trial->outcome;
  const TrustVersion* worst = WorstActive(*trial);
  std::string text = fmt::format("{}{}: {} versions",
                                 HasFailed(*trial) ? "FAILURE " : "",
                                 trial->Name(),
                                 outcome.versions.size());
  if (worst == nullptr) {
    text += HasActive(*trial) ? ", truth unknown" : ", none became active";
  } else {
    text += fmt::format(", worst active {}: NEES {:.1f} of {}, {:.1f} sigma {}",
                        worst->stored.version,
                        worst->error->nees,
                        worst->error->degrees,
                        worst->error->sigmas,
                        worst->error->component);
  }
  if (outcome.final_error) {
    text += fmt::format(", final {}: NEES {:.1f}",
                        outcome.final_version,
                        outcome.final_error->nees);
  }
  if (const auto from_clean = FromClean(*trial)) {
    text += fmt::format(", {:.2f} sigma from clean", *from_clean);
  }
  context.Progress(text + fmt::format(" ({:.0f} + {:.0f} s)",
                                      outcome.simulation_seconds,
                                      outcome.pipeline_seconds));
}

// Ratio of the noise that a run found to the truth, by kind; empty cells where
// it has none.
void AddNoise(const Trial& trial,
              const CalibrationResult* report,
              std::vector<Cell>* row) {
  for (int i = 0; i < kNoiseKinds; ++i) {
    const auto kind = static_cast<NoiseKind>(i);
    Cell cell;
    if (report != nullptr) {
      for (const NoiseScale& factor : report->noise_scales) {
        if (factor.kind != kind) continue;
        cell = factor.factor * NoiseOf(kind, trial.rig) /
               NoiseOf(kind, trial.sensors);
      }
    }
    row->push_back(cell);
  }
}

Cell Number(double value) {
  return std::isfinite(value) ? Cell(value) : Cell(std::string("not finite"));
}
Cell NeesOf(const TrustError& error) { return Number(error.nees); }
long DegreesOf(const TrustError& error) { return error.degrees; }
Cell ProbabilityOf(const TrustError& error) {
  return Number(error.probability);
}
Cell SigmasOf(const TrustError& error) { return Number(error.sigmas); }
std::string ComponentOf(const TrustError& error) { return error.component; }

std::string StateOf(const TrustVersion& version) {
  if (version.became_active) return "active";
  return version.stored.state == server::CalibrationState::kRejected
             ? "rejected"
             : "other";
}

// The value of a check that was made.
Cell ValueOf(const server::StoredCalibration& stored, const char* name) {
  if (!stored.validation) return {};
  for (const server::ValidationCheck& check : stored.validation->checks) {
    if (check.name == name &&
        check.outcome != server::CheckOutcome::kNotTested) {
      return check.value;
    }
  }
  return {};
}

void WriteVersions(const std::vector<Trial>& trials, Context* context) {
  std::vector<std::string> columns = {"kind",
                                      "seed",
                                      "version",
                                      "state",
                                      "after segment",
                                      "NEES",
                                      "degrees",
                                      "probability",
                                      "largest error [sigma]",
                                      "component",
                                      "failure",
                                      "rank",
                                      "held",
                                      "segments",
                                      "observations",
                                      "dropped",
                                      "rms [px]",
                                      "disagreement",
                                      "bias by effects [sigma]",
                                      "verdict",
                                      "remembered",
                                      "contradicting",
                                      "unused"};
  for (int i = 0; i < kNoiseKinds; ++i) {
    columns.push_back(NoiseKindName(static_cast<NoiseKind>(i)) + " / truth");
  }
  columns.emplace_back("solve [s]");
  columns.emplace_back("reasons");
  ResultTable table(columns);
  for (const Trial& trial : trials) {
    for (const TrustVersion& version : trial.outcome.versions) {
      const server::StoredCalibration& stored = version.stored;
      const CalibrationResult* report =
          stored.report ? &*stored.report : nullptr;
      const CalibrationResult none;
      const CalibrationResult& r = report == nullptr ? none : *report;
      const auto of_error = [&](auto value) {
        return version.error ? Cell(value(*version.error)) : Cell();
      };
      std::vector<Cell> row = {trial.kind->name,
                               static_cast<long>(trial.seed),
                               static_cast<long>(stored.version),
                               StateOf(version),
                               static_cast<long>(version.after_segment),
                               of_error(NeesOf),
                               of_error(DegreesOf),
                               of_error(ProbabilityOf),
                               of_error(SigmasOf),
                               of_error(ComponentOf),
                               IsSilentFailure(version) ? "FAILURE" : "",
                               static_cast<long>(r.rank),
                               static_cast<long>(r.held_constant.size()),
                               static_cast<long>(r.segments),
                               static_cast<long>(r.observations),
                               static_cast<long>(r.observations_dropped),
                               r.reprojection_rms_after_px,
                               ValueOf(stored, "disagreement"),
                               ValueOf(stored, "effects"),
                               server::VerdictText(stored.verdict.kind),
                               static_cast<long>(r.remembered.segments),
                               static_cast<long>(r.remembered.contradicting),
                               r.remembered.unused};
      AddNoise(trial, report, &row);
      row.push_back(stored.seconds);
      row.push_back(fmt::format("{}", fmt::join(stored.reasons, "; ")));
      table.Add(std::move(row));
    }
  }
  context->WriteTable("versions", table);
}

void WriteDevices(const std::vector<Trial>& trials, Context* context) {
  ResultTable table({"kind",
                     "seed",
                     "segments",
                     "versions",
                     "rejected",
                     "runs without a version",
                     "change after segment",
                     "detected after",
                     "active version",
                     "verdict on it",
                     "NEES of it",
                     "degrees",
                     "largest error [sigma]",
                     "component",
                     "largest error in use [sigma]",
                     "worst NEES of an active one",
                     "from clean [sigma]",
                     "failure",
                     "simulation [s]",
                     "pipeline [s]"});
  for (const Trial& trial : trials) {
    if (trial.missing) continue;
    const TrustOutcome& o = trial.outcome;
    const TrustVersion* worst = WorstActive(trial);
    const auto from_clean = FromClean(trial);
    long rejected = 0;
    for (const TrustVersion& version : o.versions) {
      rejected += StateOf(version) == "rejected";
    }
    const auto of_final = [&](auto value) {
      return o.final_error ? Cell(value(*o.final_error)) : Cell();
    };
    table.Add({trial.kind->name,
               static_cast<long>(trial.seed),
               static_cast<long>(o.segments),
               static_cast<long>(o.versions.size()),
               rejected,
               static_cast<long>(o.failed_runs.size()),
               o.before_change > 0 ? Cell(long{o.before_change}) : Cell(),
               fmt::format("{}", fmt::join(o.changes, " ")),
               static_cast<long>(o.final_version),
               server::VerdictText(o.final_verdict),
               of_final(NeesOf),
               of_final(DegreesOf),
               of_final(SigmasOf),
               of_final(ComponentOf),
               Number(o.largest_sigmas_in_use),
               worst == nullptr ? Cell() : NeesOf(*worst->error),
               from_clean ? Number(*from_clean) : Cell(),
               HasFailed(trial) ? "FAILURE" : "",
               o.simulation_seconds,
               o.pipeline_seconds});
  }
  context->WriteTable("devices", table);
}

// The devices of a kind together.
struct KindSummary {
  int devices = 0, active = 0, failures = 0;
  int judged = 0;  // active, with known truth
  double nees = 0;
  int degrees = 0;
  std::vector<double> from_clean;

  // Of at least one that was judged, with the upper 95 % bound.
  double MeanNees() const { return nees / judged; }
  double Bound() const {
    return NeesBounds(degrees / judged, judged, kNeesProbability).second;
  }
};

std::vector<std::pair<const TrustKind*, KindSummary>> Summarise(
    const std::vector<Trial>& trials) {
  std::vector<std::pair<const TrustKind*, KindSummary>> kinds;
  for (const Trial& trial : trials) {
    if (trial.missing) continue;
    if (kinds.empty() || kinds.back().first != trial.kind) {
      kinds.push_back({trial.kind, {}});
    }
    KindSummary& sum = kinds.back().second;
    ++sum.devices;
    sum.failures += HasFailed(trial);
    if (const auto from_clean = FromClean(trial)) {
      sum.from_clean.push_back(*from_clean);
    }
    sum.active += HasActive(trial);
    if (trial.outcome.final_error) {
      ++sum.judged;
      sum.nees += trial.outcome.final_error->nees;
      sum.degrees += trial.outcome.final_error->degrees;
    }
  }
  return kinds;
}

// The count that chance alone exceeds in less than one case of 1,000.
int LargestByChance(int trials, double rate) {
  int count = 0;
  while (BinomialTail(count + 1, trials, rate) >= kByChance) ++count;
  return count;
}

void ReportKinds(const std::vector<Trial>& trials, Context* context) {
  ResultTable table({"kind",
                     "about",
                     "devices",
                     "with an active version",
                     "mean NEES of it",
                     "degrees",
                     "95 % up to",
                     "silent failures",
                     "from clean, largest [sigma]"});
  for (const auto& [kind, sum] : Summarise(trials)) {
    const double share = static_cast<double>(sum.active) / sum.devices;
    table.Add({kind->name,
               kind->about,
               static_cast<long>(sum.devices),
               static_cast<long>(sum.active),
               sum.judged > 0 ? Cell(sum.MeanNees()) : Cell(),
               sum.judged > 0 ? Cell(long{sum.degrees / sum.judged}) : Cell(),
               sum.judged > 0 ? Cell(sum.Bound()) : Cell(),
               static_cast<long>(sum.failures),
               sum.from_clean.empty()
                   ? Cell()
                   : Cell(*std::max_element(sum.from_clean.begin(),
                                            sum.from_clean.end()))});
    const std::string prefix = "trust." + kind->name;
    // Honest motion by hand must give a version, the rest is stated.
    context->AtLeast(prefix + ".activated",
                     share,
                     kind->name == "handheld" || kind->name == "mixed" ? 1 : 0);
    if (sum.judged > 0) {
      context->AtMost(prefix + ".nees_mean", sum.MeanNees(), sum.Bound());
    }
    if (!sum.from_clean.empty()) {
      context->AtMost(
          prefix + ".from_clean",
          *std::max_element(sum.from_clean.begin(), sum.from_clean.end()),
          kMaxFromClean,
          {.unit = "sigma"});
    }
  }
  context->WriteTable("kinds", table);
}

void ReportAll(const std::vector<Trial>& trials, Context* context) {
  int active = 0, unlikely = 0;
  for (const Trial& trial : trials) {
    if (!trial.outcome.final_error) continue;
    ++active;
    unlikely += trial.outcome.final_error->probability < kUnlikely;
  }
  context->AtMost("trust.silent_failures",
                  std::count_if(trials.begin(), trials.end(), HasFailed),
                  0,
                  {.unit = "devices"});
  if (active > 0) {
    context->AtMost("trust.beyond_99_percent",
                    unlikely,
                    LargestByChance(active, kUnlikely),
                    {.unit = fmt::format("of {} devices", active)});
  }
}

}  // namespace

void RunTrust(Context* context) {
  // What the pipeline has to say of runs that end without a version is in the
  // tables.
  spdlog::set_level(spdlog::level::off);
  std::vector<Trial> trials = ListTrials(context->quick());
  context->ForEach(static_cast<int>(trials.size()),
                   [&](int i) { Run(&trials[i], *context); });
  WriteVersions(trials, context);
  WriteDevices(trials, context);
  ReportKinds(trials, context);
  ReportAll(trials, context);
}

}  // namespace selfcal
