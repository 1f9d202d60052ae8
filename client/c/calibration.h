// A published version of the calibration, as the C interface shows it.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "client/c/selfcal.h"
#include "client/selfcal/client.h"
#include "core/model/calibration.h"

namespace selfcal::c {

// Immutable, and shared by its owners.
struct PublishedVersion {
  client::CalibrationVersion version;
  std::vector<TangentComponent> components;
  Eigen::VectorXd values;  // of the components, for display
};

std::shared_ptr<const PublishedVersion> Publish(
    const client::CalibrationVersion& version);

}  // namespace selfcal::c

struct selfcal_calibration {
  std::shared_ptr<const selfcal::c::PublishedVersion> published;
};
