// New devices of a cohort: how much sooner their calibration is certain with
// the statistics of the devices before them as the prior, and whether it stays
// honest, also for devices that are not like the cohort.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/population/consistency.h"
#include "core/population/device.h"
#include "core/population/estimate.h"
#include "core/population/new_device.h"
#include "core/simulation/simulate.h"
#include "server/pipeline/candidate_validation.h"
#include "test/evaluation/context.h"
#include "test/evaluation/estimators.h"
#include "test/evaluation/statistics.h"

namespace selfcal {
namespace {

constexpr int kMostSegments = 8;
constexpr double kSegment_s = 4;
// Devices differ from their mean by this share of the factory's tolerances, and
// the mean from the reference by the second.
constexpr double kSpread = 0.2;
constexpr double kMeanOffset = 0.5;
// Excitation of the motion of the devices of the cohort, and of new ones.
constexpr double kVigorous = 0.5;
constexpr double kCalm = 0.1;
// The mean of the other cohort differs by as many spreads in each component.
constexpr double kOtherCohort = 3;
// A new device takes the prior of its cohort unless its data is this unlikely.
constexpr double kContradiction = 0.01;

// As far as a factory's calibration is off (CalibrationError).
Rig CohortRig() {
  Rig rig = HandheldRig("device");
  rig.prior_sigmas = {{"*.scale.*", 0.01},
                      {"*.misalignment.*", 0.01},
                      {"imu.q_AI.*", 0.0175},
                      {"*.q_CI.*", 0.0175},
                      {"*.p_CI.*", 0.01},
                      {"*.focal.*", 5},
                      {"*.principal.*", 5},
                      {"*.distortion.*", 0.01}};
  return rig;
}

struct Truths {
  Eigen::VectorXd mu;     // of the cohort, from the reference
  Eigen::VectorXd sigma;  // of devices about it
};

Truths CohortTruths(const Rig& rig) {
  std::mt19937_64 random(2024);
  std::normal_distribution<double> normal;
  const Eigen::VectorXd tolerance = PriorSigmas(rig);
  Truths truths{Eigen::VectorXd::Zero(tolerance.size()),
                Eigen::VectorXd::Zero(tolerance.size())};
  for (const int i : FreeComponents(rig)) {
    truths.mu(i) = kMeanOffset * tolerance(i) * normal(random);
    truths.sigma(i) = kSpread * tolerance(i);
  }
  return truths;
}

Eigen::VectorXd DrawDevice(const Truths& truths, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Eigen::VectorXd offset = truths.mu;
  for (Eigen::Index i = 0; i < offset.size(); ++i) {
    offset(i) += truths.sigma(i) * normal(random);
  }
  return offset;
}

struct PopulationDevice {
  Calibration truth;
  std::vector<MotionSegment> segments;
};

PopulationDevice MakeDevice(const Rig& rig,
                            const Eigen::VectorXd& offset,
                            double excitation,
                            std::uint64_t seed) {
  PopulationDevice device;
  device.truth = BoxPlus(rig.factory, offset);
  SimulationOptions options;
  options.seed = seed;
  options.landmarks_in_view = 60;
  const double duration_s = kMostSegments * kSegment_s + 1;
  device.segments = Simulate(rig,
                             device.truth,
                             rig.factory,
                             *MakeHandheld(duration_s, excitation, seed),
                             "session",
                             options)
                        .segments;
  return device;
}

// Uses the first segments; the result may not have converged.
CalibrationResult CalibrateDevice(const Rig& rig,
                                  const PopulationDevice& device,
                                  int segments,
                                  const std::optional<ThetaPrior>& prior) {
  CalibrateOptions options = ComparedOptions();
  options.prior = prior;
  const std::vector<MotionSegment> used(device.segments.begin(),
                                        device.segments.begin() + segments);
  return Calibrate(rig, rig.factory, used, options);
}

ThetaPrior CohortPrior(const Cohort& cohort) {
  const DevicePrediction predicted = PredictDevice(cohort);
  const auto size = predicted.mean.size();
  return {
      BoxPlus(cohort.reference, predicted.mean),
      predicted.covariance.llt().solve(Eigen::MatrixXd::Identity(size, size))};
}

// The course of a new device: after each number of segments.
struct Course {
  std::vector<double> sigma;  // rms over components, in tolerances
  std::vector<double> nees;
  // True if the daemon would reject it.
  std::vector<bool> rejected;
};

struct CohortCourse {
  Course alone;  // without the prior of its cohort
  Course with_prior;
  // Its segments show that it is of another cohort.
  std::vector<bool> contradicts;
  // The chance that they would show it to the best test (BestPower).
  std::vector<double> best_power;
};

// The chance that a device whose own cohort has its mean at this distance is
// found by the test that knows that mean, at a rate of false alarms of
// kContradiction: no test of the same segments finds more.
double BestPower(const DevicePrediction& cohort,
                 const ThetaInformation& device,
                 const Eigen::VectorXd& distance) {
  constexpr double kThreshold = 2.3263;  // one-sided, in sigmas
  const auto size = distance.size();
  const Eigen::MatrixXd spread_and_noise =
      Eigen::MatrixXd::Identity(size, size) + device.Lambda * cohort.covariance;
  const double in_sigmas = std::sqrt(
      distance.dot(spread_and_noise.lu().solve(device.Lambda * distance)));
  return 0.5 * std::erfc((kThreshold - in_sigmas) / std::sqrt(2.0));
}

// The rms over the components, in tolerances of `rig`.
double SigmaRms(const Rig& rig, const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd relative =
      covariance.diagonal().cwiseSqrt().cwiseQuotient(PriorSigmas(rig));
  return std::sqrt(relative.squaredNorm() /
                   static_cast<double>(relative.size()));
}

// The checks converged and prior_agreement of the daemon.
bool IsRejected(const Rig& rig, const CalibrationResult& result) {
  if (result.status != CalibrateStatus::kConverged) return true;
  const server::CandidateLimits limits;
  return ErrorRatio(CompareWithPrior(rig, result.theta, result.covariance),
                    limits) > limits.max_error_ratio;
}

void Add(const Rig& rig,
         const PopulationDevice& device,
         const CalibrationResult& result,
         Course* course) {
  static const Rig kReference = CohortRig();
  course->sigma.push_back(SigmaRms(kReference, result.covariance));
  course->rejected.push_back(IsRejected(rig, result));
  course->nees.push_back(
      NormalisedSquaredError(BoxMinus(result.theta, device.truth),
                             result.covariance)
          .nees);
}

// Calibrates a device as `rig`, on each of these numbers of its segments.
Course Follow(const Rig& rig,
              const PopulationDevice& device,
              const std::vector<int>& numbers) {
  Course course;
  for (const int n : numbers) {
    Add(rig, device, CalibrateDevice(rig, device, n, std::nullopt), &course);
  }
  return course;
}

// The same without and with the prior of a cohort, which a device that
// contradicts it does not take. `distance`: that of the mean of its own cohort.
CohortCourse FollowInCohort(const Rig& rig,
                            const PopulationDevice& device,
                            const Cohort& cohort,
                            const Eigen::VectorXd& distance,
                            const std::vector<int>& numbers) {
  CohortCourse course;
  for (const int n : numbers) {
    CalibrationResult result = CalibrateDevice(rig, device, n, std::nullopt);
    Add(rig, device, result, &course.alone);
    const ThetaInformation information = DeviceInformation(
        rig, result.theta, result.covariance, cohort.reference);
    course.best_power.push_back(
        BestPower(PredictDevice(cohort), information, distance));
    course.contradicts.push_back(
        CompareWithCohort(cohort, information).probability < kContradiction);
    if (!course.contradicts.back()) {
      result = CalibrateDevice(rig, device, n, CohortPrior(cohort));
    }
    Add(rig, device, result, &course.with_prior);
  }
  return course;
}

// The number of segments until sigma is at most the target; one more than all
// if it never is.
int Until(const std::vector<double>& sigma,
          const std::vector<int>& numbers,
          double target) {
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    if (sigma[k] <= target) return numbers[k];
  }
  return numbers.back() + 1;
}

// Over the courses, after the number of segments at this index.
double MeanNees(const std::vector<Course>& courses, std::size_t k) {
  double sum = 0;
  for (const Course& course : courses) sum += course.nees[k];
  return sum / static_cast<double>(courses.size());
}

int Rejected(const std::vector<Course>& courses, std::size_t k) {
  int rejected = 0;
  for (const Course& course : courses) rejected += course.rejected[k];
  return rejected;
}

bool IsEverFound(const CohortCourse& course) {
  return std::count(
             course.contradicts.begin(), course.contradicts.end(), true) > 0;
}

double RmsSigma(const std::vector<Course>& courses, std::size_t k) {
  std::vector<double> sigmas;
  for (const Course& course : courses) sigmas.push_back(course.sigma[k]);
  return Rms(sigmas);
}

}  // namespace

void RunPopulation(Context* context) {
  const Rig rig = CohortRig();
  const Truths truths = CohortTruths(rig);
  const int size = static_cast<int>(FreeComponents(rig).size());
  const int devices = context->quick() ? 8 : 50;
  const int fresh = context->quick() ? 1 : 20;
  const int foreign = context->quick() ? 1 : 10;
  const std::vector<int> numbers =
      context->quick() ? std::vector<int>{1, 2, 4, kMostSegments}
                       : std::vector<int>{1, 2, 3, 4, 5, 6, 7, kMostSegments};

  // The cohort, of which one device has a camera that was knocked by 5 cm.
  std::vector<ThetaInformation> information(devices);
  constexpr int kBroken = 3;
  const auto knocked = [&](Eigen::VectorXd offset) {
    offset(CameraTangentOffset(rig.factory, 0) + kCameraPosition) += 0.05;
    return offset;
  };
  context->ForEach(devices, [&](int i) {
    Eigen::VectorXd offset = DrawDevice(truths, 1000 + i);
    if (i == kBroken) offset = knocked(offset);
    const PopulationDevice device =
        MakeDevice(rig, offset, kVigorous, 1000 + i);
    const CalibrationResult result = CalibrateOn(
        rig, device.segments, AllSegments(kMostSegments), ComparedOptions());
    information[i] =
        DeviceInformation(rig, result.theta, result.covariance, rig.factory);
  });
  context->Progress(std::to_string(devices) + " devices calibrated");
  const Cohort cohort =
      EstimateCohort(rig.factory, PriorSigmas(rig), information);
  const std::vector<int> expected_outliers = {kBroken};
  context->AtLeast("population.broken_device_found",
                   cohort.outliers == expected_outliers,
                   1,
                   {.robust = true});
  const Eigen::VectorXd mu_error = cohort.mu - truths.mu;
  context->AtMost(
      "population.mean_nees",
      mu_error.dot(cohort.mu_covariance.llt().solve(mu_error)) / size,
      1.8);
  Eigen::VectorXd spread_ratio =
      cohort.S.diagonal().cwiseSqrt().cwiseQuotient(truths.sigma);
  std::sort(spread_ratio.data(), spread_ratio.data() + spread_ratio.size());
  context->Within("population.spread_median_ratio",
                  spread_ratio(spread_ratio.size() / 2),
                  0.8,
                  1.3);

  // New devices: with the factory's prior, and with that of the cohort.
  // As a rig that the daemon describes, they have no test against the cohort.
  const Rig described = DescribeNewDevice(rig, cohort);
  std::vector<Course> factory(fresh), prior(fresh), as_described(fresh);
  std::vector<CohortCourse> other(foreign);
  std::vector<Course> other_as_described(foreign);
  bool knocked_found = false;
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(truths.mu.size());
  context->ForEach(fresh + foreign + 1, [&](int i) {
    if (i < fresh) {
      const std::uint64_t seed = 5000 + i;
      const PopulationDevice device =
          MakeDevice(rig, DrawDevice(truths, seed), kCalm, seed);
      CohortCourse course = FollowInCohort(rig, device, cohort, none, numbers);
      factory[i] = std::move(course.alone);
      prior[i] = std::move(course.with_prior);
      as_described[i] = Follow(described, device, numbers);
    } else if (i < fresh + foreign) {
      Truths elsewhere = truths;
      elsewhere.mu += kOtherCohort * truths.sigma;
      const std::uint64_t seed = 7000 + fresh + i;
      const PopulationDevice device =
          MakeDevice(rig, DrawDevice(elsewhere, seed), kCalm, seed);
      other[i - fresh] = FollowInCohort(
          rig, device, cohort, kOtherCohort * truths.sigma, numbers);
      other_as_described[i - fresh] = Follow(described, device, numbers);
    } else {
      knocked_found = IsEverFound(FollowInCohort(
          rig,
          MakeDevice(rig, knocked(DrawDevice(truths, 9000)), kCalm, 9000),
          cohort,
          knocked(none),
          numbers));
    }
  });

  ResultTable table({"segments",
                     "sigma, factory's prior",
                     "sigma, cohort's prior",
                     "sigma, as described",
                     "NEES, factory's prior",
                     "NEES, cohort's prior",
                     "NEES, as described",
                     "NEES, other cohort",
                     "found of them",
                     "found by the best test",
                     "NEES, other cohort as described",
                     "rejected of them",
                     "rejected of this cohort"});
  std::vector<Course> other_with_prior;
  for (const CohortCourse& course : other) {
    other_with_prior.push_back(course.with_prior);
  }
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    long found = 0;
    double best = 0;
    for (const CohortCourse& course : other) {
      found += course.contradicts[k];
      best += course.best_power[k];
    }
    table.Add({long{numbers[k]},
               RmsSigma(factory, k),
               RmsSigma(prior, k),
               RmsSigma(as_described, k),
               MeanNees(factory, k),
               MeanNees(prior, k),
               MeanNees(as_described, k),
               MeanNees(other_with_prior, k),
               found,
               best,
               MeanNees(other_as_described, k),
               long{Rejected(other_as_described, k)},
               long{Rejected(as_described, k) + Rejected(factory, k)}});
  }
  context->WriteTable("new_devices", table);

  double segments_factory = 0;
  double segments_cohort = 0;
  double segments_described = 0;
  for (int i = 0; i < fresh; ++i) {
    const double target = factory[i].sigma.back();
    segments_factory += kMostSegments;
    segments_cohort += Until(prior[i].sigma, numbers, target);
    segments_described += Until(as_described[i].sigma, numbers, target);
  }
  context->AtLeast(
      "population.segments_saved", segments_factory / segments_cohort, 2);
  context->AtLeast("population.described_segments_saved",
                   segments_factory / segments_described,
                   2);
  // Mean NEES of new devices, over all numbers of segments: its 95 % bounds are
  // those of as many independent devices.
  const double bound = size + 1.96 * std::sqrt(2.0 * size / fresh);
  const double other_bound = size + 1.96 * std::sqrt(2.0 * size / foreign);
  double largest = 0;
  double largest_described = 0;
  double largest_other = 0;
  int rejected = 0;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    largest = std::max(largest, MeanNees(prior, k));
    largest_described = std::max(largest_described, MeanNees(as_described, k));
    largest_other = std::max(largest_other, MeanNees(other_with_prior, k));
    rejected += Rejected(as_described, k) + Rejected(factory, k);
  }
  context->AtMost("population.nees", largest, bound);
  context->AtMost("population.described_nees", largest_described, bound);
  // The daemon would reject every device of the other cohort once it has as
  // many segments as a table holds, and none of this one.
  context->AtMost("population.described_rejected", rejected, 0);
  context->AtLeast(
      "population.described_other_rejected",
      double(Rejected(other_as_described, numbers.size() - 1)) / foreign,
      1,
      {.robust = true});
  context->AtMost("population.other_cohort_nees", largest_other, other_bound);
  context->AtLeast(
      "population.other_cohort_found",
      double(std::count_if(other.begin(), other.end(), IsEverFound)) / foreign,
      1,
      {.robust = true});
  context->AtLeast(
      "population.knocked_found", knocked_found, 1, {.robust = true});
}

}  // namespace selfcal
