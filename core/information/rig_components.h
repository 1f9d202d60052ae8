// The properties of a rig that a score needs, computed once: its free
// components, their scales, names and groups.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/model/rig.h"

namespace selfcal {

class RigComponents {
 public:
  struct Group {
    std::string name;
    std::vector<int> at;  // indices among the free components, sorted
    std::vector<std::string> names;  // of its components
    double log_scale = 0;            // sum of ln(prior / reference)
  };

  RigComponents() = default;
  explicit RigComponents(const Rig& rig);

  // Returns true if the constructor would give the same for `rig`.
  bool Fits(const Rig& rig) const;

  int size() const { return static_cast<int>(prior_.size()); }
  const std::vector<int>& free() const { return free_; }
  const std::vector<std::string>& free_names() const { return free_names_; }
  const Eigen::VectorXd& prior() const { return prior_; }  // of all components
  // One for each camera.
  const std::vector<char>& estimated_time_offsets() const {
    return estimated_time_offsets_;
  }
  const std::vector<Group>& groups() const { return groups_; }

 private:
  // Settings from which all of this is derived; of the factory calibration the
  // shape and the sizes of images.
  Calibration factory_;
  std::vector<ParameterGroup> group_settings_;
  std::vector<ComponentSetting> prior_sigmas_;
  std::vector<std::string> fixed_;
  std::vector<BlockSetting> blocks_;

  std::vector<int> free_;
  std::vector<std::string> free_names_;
  Eigen::VectorXd prior_;
  std::vector<char> estimated_time_offsets_;
  std::vector<Group> groups_;
};

}  // namespace selfcal
