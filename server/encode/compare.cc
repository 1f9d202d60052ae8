#include "server/encode/compare.h"

#include <algorithm>
#include <iterator>

#include "core/change/compare.h"
#include "server/status/status_macros.h"

namespace selfcal::server {
namespace {

// Significance level: by chance, one comparison in a hundred is significant.
constexpr double kSignificant = 0.01;

KnownCalibration Known(const StoredCalibration& calibration) {
  const double factor =
      calibration.report ? calibration.report->track_noise_factor : 1;
  return {calibration.theta, calibration.covariance, factor};
}

std::vector<SegmentKey> SharedKeys(const StoredCalibration& a,
                                   const StoredCalibration& b) {
  std::vector<SegmentKey> shared;
  std::copy_if(a.segments.begin(),
               a.segments.end(),
               std::back_inserter(shared),
               [&](const SegmentKey& key) {
                 return std::find(b.segments.begin(), b.segments.end(), key) !=
                        b.segments.end();
               });
  return shared;
}

// Reads the information of those segments for which it is readable.
absl::StatusOr<std::vector<SegmentInformation>> ReadInformation(
    Store* store,
    const std::string& rig,
    const std::vector<SegmentKey>& segments) {
  std::vector<SegmentInformation> read;
  for (const SegmentKey& key : segments) {
    auto segment = store->GetSegment(rig, key);
    if (absl::IsDataLoss(segment.status())) continue;
    SELFCAL_RETURN_IF_ERROR(segment.status());
    if (segment->information) {
      read.push_back(*std::move(segment->information));
    }
  }
  return read;
}

void FillDifferences(const Rig& rig,
                     const StoredCalibration& a,
                     const StoredCalibration& b,
                     const CalibrationDifference& compared,
                     v1::CompareCalibrationsResponse* response) {
  const auto components = TangentComponents(rig.factory);
  const Eigen::VectorXd values_a = ReadableValues(a.theta);
  const Eigen::VectorXd values_b = ReadableValues(b.theta);
  const Eigen::VectorXd from_factory_a = BoxMinus(a.theta, rig.factory);
  const Eigen::VectorXd from_factory_b = BoxMinus(b.theta, rig.factory);
  for (const int i : FreeComponents(rig)) {
    auto* difference = response->add_differences();
    difference->set_component(components[i].name);
    difference->set_unit(components[i].unit);
    difference->set_value_a(values_a[i]);
    difference->set_value_b(values_b[i]);
    difference->set_from_factory_a(from_factory_a[i]);
    difference->set_from_factory_b(from_factory_b[i]);
    difference->set_difference(compared.difference[i]);
    difference->set_sigma(compared.sigmas[i]);
  }
}

}  // namespace

absl::StatusOr<v1::CompareCalibrationsResponse> Compare(
    Store* store, const StoredCalibration& a, const StoredCalibration& b) {
  SELFCAL_ASSIGN_OR_RETURN(const StoredRig rig, store->GetRig(a.rig));
  const std::vector<SegmentKey> shared = SharedKeys(a, b);
  SELFCAL_ASSIGN_OR_RETURN(const std::vector<SegmentInformation> information,
                           ReadInformation(store, a.rig, shared));
  const CalibrationDifference compared =
      CompareCalibrations(rig.rig, Known(a), Known(b), information);
  v1::CompareCalibrationsResponse response;
  response.set_version_a(a.version);
  response.set_version_b(b.version);
  FillDifferences(rig.rig, a, b, compared, &response);
  response.set_chi_square(compared.test.statistic);
  response.set_degrees(compared.test.degrees);
  response.set_probability(compared.test.probability);
  response.set_significant(compared.test.probability < kSignificant);
  response.set_shared_segments(static_cast<int>(shared.size()));
  response.set_shared_segments_used(static_cast<int>(information.size()));
  return response;
}

}  // namespace selfcal::server
