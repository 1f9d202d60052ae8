// What a calibration from before a change of the device still says after it.
// Pure.
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

// `since`: what the segments since the change show. `before` is the
// calibration from before it (change.base_version). Groups that the change was
// not found to concern may have changed all the same, by as much as these
// segments would not show: what was known of them is as much less certain
// (core/change/group_concern.h).

// The prior of the runs after it: what `before` knows of the components that
// the change does not concern.
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

// Groups of parameters that may go on to change: those of a drift, or of two
// changes that follow each other.
std::vector<std::string> ChangingGroups(
    const StoredChange& newest, const std::optional<StoredChange>& earlier);

}  // namespace selfcal::server
