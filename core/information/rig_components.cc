#include "core/information/rig_components.h"

#include <algorithm>
#include <cmath>

namespace selfcal {

RigComponents::RigComponents(const Rig& rig)
    : factory_(rig.factory),
      group_settings_(rig.groups),
      prior_sigmas_(rig.prior_sigmas),
      fixed_(rig.fixed),
      blocks_(rig.blocks),
      free_(FreeComponents(rig)),
      prior_(PriorSigmas(rig)),
      estimated_time_offsets_(EstimatedTimeOffsets(rig)) {
  const std::vector<TangentComponent> components =
      TangentComponents(rig.factory);
  const Eigen::VectorXd reference = ReferenceSigmas(rig);
  for (const int i : free_) free_names_.push_back(components[i].name);
  for (const ParameterGroup& settings : rig.groups) {
    Group group;
    group.name = settings.name;
    for (const int i : GroupComponents(rig, settings)) {
      const auto at = std::lower_bound(free_.begin(), free_.end(), i);
      group.at.push_back(static_cast<int>(at - free_.begin()));
      group.names.push_back(components[i].name);
      group.log_scale += std::log(prior_(i) / reference(i));
    }
    groups_.push_back(std::move(group));
  }
}

bool RigComponents::Fits(const Rig& rig) const {
  const auto same_group = [](const ParameterGroup& a, const ParameterGroup& b) {
    return a.name == b.name && a.patterns == b.patterns;
  };
  const auto same_setting = [](const ComponentSetting& a,
                               const ComponentSetting& b) {
    return a.pattern == b.pattern && a.value == b.value;
  };
  // Sigmas in pixels depend on the resolution.
  const auto same_width = [](const CameraCalibration& a,
                             const CameraCalibration& b) {
    return a.width_px == b.width_px;
  };
  return !factory_.cameras.empty() && fixed_ == rig.fixed &&
         blocks_ == rig.blocks && SameShape(factory_, rig.factory) &&
         std::equal(factory_.cameras.begin(),
                    factory_.cameras.end(),
                    rig.factory.cameras.begin(),
                    rig.factory.cameras.end(),
                    same_width) &&
         std::equal(group_settings_.begin(),
                    group_settings_.end(),
                    rig.groups.begin(),
                    rig.groups.end(),
                    same_group) &&
         std::equal(prior_sigmas_.begin(),
                    prior_sigmas_.end(),
                    rig.prior_sigmas.begin(),
                    rig.prior_sigmas.end(),
                    same_setting);
}

}  // namespace selfcal
