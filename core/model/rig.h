// A rig: one physical device, what its maker knew about it, and how its
// segments are judged. Groups of parameters are configuration.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

// Continuous-time densities.
struct ImuNoise {
  double gyro_noise_density = 1.7e-4;    // [rad/s/sqrt(Hz)]
  double accel_noise_density = 2e-3;     // [m/s^2/sqrt(Hz)]
  double gyro_bias_random_walk = 2e-5;   // [rad/s^2/sqrt(Hz)]
  double accel_bias_random_walk = 3e-3;  // [m/s^3/sqrt(Hz)]
};

// A named set of tangent components. A pattern is the name of a component, or
// begins or ends with '*' (or both), which stands for anything: "imu.*",
// "*.focal.x".
struct ParameterGroup {
  std::string name;
  std::vector<std::string> patterns;
};

// The paper's three: "imu", "camera" (f, c, distortion of every camera) and
// "extrinsics" (q_CI, p_CI of every camera); and where time offsets are
// estimated "time" (of every camera).
std::vector<ParameterGroup> DefaultGroups(bool estimate_time_offset = false);

// A value given to all components that match a pattern.
struct ComponentSetting {
  std::string pattern;
  double value = 0;
};

// Which segments are kept.
enum class Selection {
  kTables,  // the paper's: for each group those of lowest entropy
  // One set for all of theta, by its joint information (core/selection).
  kJointD,
  kJointA,
  kJointE,
};

// The name of the one table of a rig with a joint selection.
inline constexpr char kJointTable[] = "joint";

struct Rig {
  std::string id;  // [a-z0-9_-]{1,63}
  Calibration factory;
  ImuNoise imu_noise;
  double pixel_sigma_px = 1.0;
  double gravity_mps2 = 9.81;  // g = (0, 0, -gravity) in G
  std::vector<ParameterGroup> groups = DefaultGroups();
  // Prior standard deviations (factory tolerances) by component, in its unit;
  // later ones win. Without one: 10 sigma_ref.
  std::vector<ComponentSetting> prior_sigmas;
  // Patterns of components that are never estimated.
  std::vector<std::string> fixed;
  // Without it every camera's time offset is known: held as if it were fixed.
  bool estimate_time_offset = false;
  Selection selection = Selection::kTables;
  // N: segments of a table. A joint set holds N for each group.
  int table_size = 8;
  // A segment enters a table only if it gains at least this for the group.
  double min_gain_nats = 1.0;
  // After the first run, the next starts when at least this part of the
  // entries of the tables is new since the last.
  double retrigger_fraction = 0.5;
  // Calibrations weight by the noise that their residuals suggest, as far as
  // these determine it, instead of by what is stated above.
  bool reweight_noise = false;
};

// Indices of the tangent components that match at least one pattern, sorted.
std::vector<int> MatchComponents(
    const std::vector<TangentComponent>& components,
    const std::vector<std::string>& patterns);

// Components of a group of this rig, sorted, without those held fixed.
std::vector<int> GroupComponents(const Rig& rig, const ParameterGroup& group);

// Components that are estimated (not fixed), sorted.
std::vector<int> FreeComponents(const Rig& rig);

// Of each camera whether its time offset is estimated.
std::vector<char> EstimatedTimeOffsets(const Rig& rig);

// Prior standard deviation of every tangent component, in its unit.
Eigen::VectorXd PriorSigmas(const Rig& rig);

// sigma_ref of every tangent component, in its unit.
Eigen::VectorXd ReferenceSigmas(const Rig& rig);

// Every violation: id, positive and finite numbers, unit quaternions, at least
// one camera, image sizes, distortion in range, groups that match nothing or
// share a name, patterns that match nothing, everything fixed. Names of groups
// follow the rules of the id, and a group keeps at least one component that is
// not fixed; with a joint selection, none is named as its table. Paths of the
// calibration begin with "factory".
std::vector<Violation> Validate(const Rig& rig);

// The same rules for a calibration alone; paths begin with `prefix` and a dot,
// unless it is empty.
std::vector<Violation> Validate(const Calibration& theta,
                                const std::string& prefix);

}  // namespace selfcal
