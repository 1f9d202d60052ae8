#include "server/encode/encode_cohort.h"

#include <algorithm>
#include <cmath>

#include "core/model/calibration.h"
#include "core/population/estimate.h"
#include "core/population/new_device.h"
#include "proto/resource_names.h"
#include "server/encode/encode.h"
#include "server/encode/set_time.h"

namespace selfcal::server {
namespace {

constexpr std::size_t kMostComponents = 5;  // of an outlier

double Sigma(const Eigen::MatrixXd& covariance, Eigen::Index j) {
  return std::sqrt(std::max(covariance(j, j), 0.0));
}

void EncodeOutlier(const CohortReport::Outlier& outlier,
                   const std::vector<TangentComponent>& components,
                   v1::CohortOutlier* message) {
  message->set_rig(RigName(outlier.rig));
  message->set_version(outlier.version);
  message->set_probability(outlier.consistency.probability);
  const auto& found = outlier.consistency.components;
  for (std::size_t k = 0; k < std::min(found.size(), kMostComponents); ++k) {
    auto* component = message->add_components();
    const TangentComponent& known =
        components[static_cast<std::size_t>(found[k].component)];
    component->set_component(known.name);
    component->set_unit(known.unit);
    component->set_difference(found[k].difference);
    component->set_sigma(found[k].sigma);
  }
}

v1::Rig EncodePrior(const CohortReport& report) {
  StoredRig prior = report.reference;
  prior.rig = DescribeNewDevice(prior.rig, report.cohort);
  prior.labels.clear();
  v1::Rig message = Encode(prior);
  message.clear_name();
  message.clear_create_time();
  return message;
}

}  // namespace

v1::Cohort Encode(const CohortReport& report) {
  v1::Cohort message;
  const Cohort& cohort = report.cohort;
  message.set_reference(RigName(report.reference.rig.id));
  message.set_rigs(report.rigs);
  message.set_calibrated(report.calibrated);
  message.set_truncated(report.truncated);
  message.set_estimated(std::ssize(cohort.devices) >= kLeastCohort);
  const auto components = TangentComponents(cohort.reference);
  const Eigen::VectorXd values = ReadableValues(cohort.reference);
  for (std::size_t k = 0; k < components.size(); ++k) {
    const auto j = static_cast<Eigen::Index>(k);
    v1::CohortComponent* component = message.add_components();
    component->set_component(components[k].name);
    component->set_unit(components[k].unit);
    component->set_reference(values(j));
    component->set_tolerance(cohort.scale(j));
    for (Eigen::Index q = 0; q < report.quantiles.cols(); ++q) {
      component->add_quantile_offsets(report.quantiles(j, q));
    }
    if (!message.estimated()) continue;
    component->set_mean_offset(cohort.mu(j));
    component->set_mean_offset_sigma(Sigma(cohort.mu_covariance, j));
    component->set_spread(Sigma(cohort.S, j));
    component->set_spread_degrees(cohort.degrees(j));
  }
  if (message.estimated()) {
    *message.mutable_prior() = EncodePrior(report);
  }
  for (const CohortReport::Device& device : report.devices) {
    v1::CohortDevice* added = message.add_devices();
    added->set_rig(RigName(device.rig));
    added->set_version(device.version);
  }
  for (const CohortReport::Outlier& outlier : report.outliers) {
    EncodeOutlier(outlier, components, message.add_outliers());
  }
  for (const CohortReport::Skipped& skipped : report.skipped) {
    v1::SkippedRig* rig = message.add_skipped();
    rig->set_rig(RigName(skipped.rig));
    rig->set_reason(skipped.reason);
  }
  return message;
}

absl::StatusOr<v1::CohortVersion> Encode(const StoredCohort& cohort) {
  v1::CohortVersion message;
  message.set_label(cohort.label);
  message.set_value(cohort.value);
  message.set_version(cohort.version);
  SetTime(cohort.time_ns, message.mutable_create_time());
  if (!message.mutable_cohort()->ParseFromString(cohort.content)) {
    return absl::DataLossError("the statistics of the cohort " + cohort.label +
                               "=" + cohort.value + " cannot be read");
  }
  return message;
}

}  // namespace selfcal::server
