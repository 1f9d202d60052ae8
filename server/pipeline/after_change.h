// The knowledge that remains of a calibration from before a device change. Pure
// functions.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/calibration/theta_prior.h"
#include "core/information/segment_information.h"
#include "core/model/rig.h"
#include "server/store/store.h"

namespace selfcal::server {

// `since` is the information of the segments since the change, `before` the
// calibration from before it (StoredChange::base_version). Groups that the
// change was not found to concern may have changed as well, by as much as these
// segments would not show; their earlier estimates are less certain by that
// much (core/change/group_concern.h).

// The prior of the runs after the change: what `before` knows of the components
// that the change does not concern.
ThetaPrior KnownAfter(const Rig& rig,
                      const StoredChange& change,
                      const StoredCalibration& before,
                      std::span<const SegmentInformation> since);

// The covariance of `before`, with the rig's prior for the components that the
// change concerns.
Eigen::MatrixXd CovarianceAfter(const Rig& rig,
                                const StoredChange& change,
                                const StoredCalibration& before,
                                std::span<const SegmentInformation> since);

// Groups that may keep changing: those of a drift, or of two consecutive device
// changes.
std::vector<std::string> ChangingGroups(
    const StoredChange& newest, const std::optional<StoredChange>& earlier);

}  // namespace selfcal::server
