#include "test/evaluation/trust_device.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>

#include "core/change/chi_square.h"
#include "server/domain/domain.h"
#include "server/pipeline/pipeline.h"
#include "server/pipeline/verdict.h"
#include "test/evaluation/statistics.h"
#include "test/server/store/sqlite/open_sqlite_store.h"

namespace selfcal {
namespace {

constexpr double kFailureSigmas = 4.5;
constexpr double kFailureProbability = 1e-4;
constexpr std::chrono::minutes kPatience{20};  // for one segment and its run

double Seconds(std::chrono::steady_clock::duration time) {
  return std::chrono::duration<double>(time).count();
}

// A folder that goes with all it holds.
class Scratch {
 public:
  Scratch() {
    std::string pattern =
        (std::filesystem::temp_directory_path() / "selfcal-trust-XXXXXX")
            .string();
    if (mkdtemp(pattern.data()) == nullptr) {
      throw std::runtime_error("cannot make a folder like " + pattern);
    }
    path_ = pattern;
  }
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  std::string File(const std::string& name) const {
    return (path_ / name).string();
  }

 private:
  std::filesystem::path path_;
};

template <typename T>
T Get(absl::StatusOr<T> result) {
  if (!result.ok()) throw std::runtime_error(result.status().ToString());
  return *std::move(result);
}

void Check(const absl::Status& status) {
  if (!status.ok()) throw std::runtime_error(status.ToString());
}

class Driver {
 public:
  explicit Driver(const TrustDevice& device)
      : device_(device), name_(device.rig.id) {
    store_ = Get(server::OpenSqliteStore(scratch_.File("selfcal.db")));
    domain_.emplace(store_.get());
    Check(domain_->CreateRig(device.rig).status());
    pipeline_ = server::MakePipeline(&*domain_, {});
    Check(pipeline_->Start());
  }

  TrustOutcome Run() {
    int number = 0;
    for (const auto& make : device_.sessions) {
      if (number++ == device_.changed_session) {
        outcome_.before_change = outcome_.segments;
      }
      const server::StoredCalibration active =
          Get(store_->GetActiveCalibration(name_));
      const auto begin = std::chrono::steady_clock::now();
      const TrustSession session = make(active.theta);
      outcome_.simulation_seconds +=
          Seconds(std::chrono::steady_clock::now() - begin);
      truth_ = session.truth ? session.truth : device_.truth;
      for (const MotionSegment& segment : session.segments) {
        Send(segment, active.version);
      }
      EndSession();
    }
    Finish();
    return std::move(outcome_);
  }

 private:
  void Send(MotionSegment segment, std::int64_t version) {
    segment.calibration_version = version;
    const auto begin = std::chrono::steady_clock::now();
    const server::SubmitResult submitted =
        Get(pipeline_->Submit(name_, segment, nullptr));
    if (!submitted.violations.empty()) {
      const Violation& violation = submitted.violations.front();
      throw std::runtime_error(
          fmt::format("segment {} of {} is refused: {}: {}",
                      segment.key.index,
                      segment.key.session,
                      violation.field,
                      violation.message));
    }
    ++outcome_.segments;
    WaitUntilIdle();
    outcome_.pipeline_seconds +=
        Seconds(std::chrono::steady_clock::now() - begin);
    NoteNews();
  }

  // The run that the end of a session calls for, without the pause that it
  // waits for another segment: none where the tables have not changed.
  void EndSession() {
    const auto begin = std::chrono::steady_clock::now();
    Check(domain_->StartSessionRuns({name_}, 0).status());
    pipeline_->EndSession(name_);
    WaitUntilIdle();
    outcome_.pipeline_seconds +=
        Seconds(std::chrono::steady_clock::now() - begin);
    NoteNews();
  }

  // Calibrates a recording that is too short to fill the tables, unless nothing
  // of it entered them.
  void RunByHand() {
    const auto begin = std::chrono::steady_clock::now();
    const auto run = pipeline_->StartRecalibration(name_, true).status();
    if (absl::IsFailedPrecondition(run)) return;
    Check(run);
    WaitUntilIdle();
    outcome_.pipeline_seconds +=
        Seconds(std::chrono::steady_clock::now() - begin);
  }

  // Until the segment is scored and the run that it triggered has ended.
  void WaitUntilIdle() {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    // In this order: the commit of a score creates the run.
    while (!Get(store_->ListUnscored(1)).empty() ||
           !Get(store_->ListUnfinishedRuns()).empty()) {
      if (std::chrono::steady_clock::now() > deadline) {
        throw std::runtime_error("the pipeline does not come to rest");
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }

  // Versions and runs that came with the last segment.
  void NoteNews() {
    const auto runs = Get(store_->ListRuns(name_, {}));
    if (!runs.items.empty() && runs.items.front().run != last_run_) {
      for (const server::StoredRun& run : runs.items) {
        if (run.run <= last_run_) break;
        if (run.state == server::RunState::kFailed) {
          outcome_.failed_runs.push_back(run.message);
        }
      }
      last_run_ = runs.items.front().run;
      NoteVersions();
    }
    const auto next = [&] {
      return static_cast<std::int64_t>(outcome_.changes.size()) + 1;
    };
    while (store_->GetChange(name_, next()).ok()) {
      outcome_.changes.push_back(outcome_.segments);
    }
    const auto active = ErrorOfActive();
    if (active) {
      outcome_.largest_sigmas_in_use =
          std::max(outcome_.largest_sigmas_in_use, active->sigmas);
    }
  }

  // Nothing for the factory's version.
  std::optional<TrustError> ErrorOfActive() {
    const server::StoredCalibration active =
        Get(store_->GetActiveCalibration(name_));
    return active.version > 1 ? ErrorOf(active) : std::nullopt;
  }

  std::optional<TrustError> ErrorOf(
      const server::StoredCalibration& version) const {
    if (!truth_) return std::nullopt;
    return ErrorAgainst(
        device_.rig, *truth_, version.theta, version.covariance);
  }

  void NoteVersions() {
    const auto known = static_cast<std::int64_t>(outcome_.versions.size()) + 1;
    auto listed = Get(store_->ListCalibrations(name_, {})).items;
    std::reverse(listed.begin(), listed.end());
    for (server::StoredCalibration& stored : listed) {
      if (stored.version <= known) continue;
      TrustVersion version;
      version.became_active = stored.activation > 0;
      version.after_segment = outcome_.segments;
      version.error = ErrorOf(stored);
      version.stored = std::move(stored);
      outcome_.versions.push_back(std::move(version));
    }
  }

  void Finish() {
    WaitUntilIdle();
    if (last_run_ == 0) RunByHand();
    NoteNews();
    pipeline_->Stop();
    const server::StoredCalibration active =
        Get(store_->GetActiveCalibration(name_));
    outcome_.final_theta = active.theta;
    outcome_.final_covariance = active.covariance;
    outcome_.final_version = active.version;
    outcome_.final_verdict = server::VerdictOf(active).kind;
    if (active.version > 1) outcome_.final_error = ErrorOf(active);
  }

  const TrustDevice& device_;
  const std::string name_;
  const Scratch scratch_;
  std::unique_ptr<server::Store> store_;
  std::optional<server::Domain> domain_;
  std::unique_ptr<server::Pipeline> pipeline_;
  std::optional<Calibration> truth_;  // of the session
  std::int64_t last_run_ = 0;
  TrustOutcome outcome_;
};

}  // namespace

TrustError ErrorAgainst(const Rig& rig,
                        const Calibration& truth,
                        const Calibration& theta,
                        const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd error = BoxMinus(theta, truth);
  const auto components = TangentComponents(rig.factory);
  TrustError result;
  for (const int i : FreeComponents(rig)) {
    const double sigmas = std::abs(error(i)) / std::sqrt(covariance(i, i));
    // Also one that is not a number.
    if (!(sigmas <= result.sigmas)) {
      result.sigmas = sigmas;
      result.component = components[i].name;
    }
  }
  const SquaredError square = NormalisedSquaredError(error, covariance);
  result.nees = square.nees;
  result.degrees = square.dof;
  result.probability = ChiSquareTail(square.nees, square.dof);
  return result;
}

bool IsFailure(const TrustError& error) {
  return !(error.sigmas <= kFailureSigmas) ||
         !(error.probability >= kFailureProbability);
}

TrustOutcome Drive(const TrustDevice& device) { return Driver(device).Run(); }

}  // namespace selfcal
