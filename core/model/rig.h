// A rig: one physical device, its factory calibration and tolerances, and the
// settings that its segments are scored and selected with. The groups of
// parameters are configurable.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "core/model/segment.h"

namespace selfcal {

// Continuous-time noise densities and random walks.
struct ImuNoise {
  double gyro_noise_density = 1.7e-4;    // [rad/s/sqrt(Hz)]
  double accel_noise_density = 2e-3;     // [m/s^2/sqrt(Hz)]
  double gyro_bias_random_walk = 2e-5;   // [rad/s^2/sqrt(Hz)]
  double accel_bias_random_walk = 3e-3;  // [m/s^3/sqrt(Hz)]
};

// Most settings by pattern that a rig has of one kind.
inline constexpr std::size_t kMaxPatterns = 1024;

// A named set of tangent components. A pattern is the name of a component, or
// has '*' as its first or last character (or both), which matches any text:
// "imu.*", "*.focal.x".
struct ParameterGroup {
  std::string name;
  std::vector<std::string> patterns;
};

// Whether the parameter blocks with a name that matches the pattern are
// estimated; if not, they are held constant at their value. "imu.gyro.scale",
// "*.time_offset"; '*' as in a ParameterGroup.
struct BlockSetting {
  std::string pattern;
  bool estimated = true;

  bool operator==(const BlockSetting&) const = default;
};

// Whether a block ("cam0.time_offset") is estimated: as the last setting that
// matches it states, or as it is declared (parameter_blocks.h).
bool IsEstimated(const std::vector<BlockSetting>& settings,
                 const std::string& block);

// The three groups of the paper: "imu", "camera" (f, c, distortion of every
// camera) and "extrinsics" (q_CI, p_CI of every camera); "imu1" (intrinsics and
// pose of a second IMU), apart from the first one, since a segment may excite
// one of them and saturate the other; and "time" (of every camera the time
// offset and its slope, the line delay and the time drift).
// Only those of which a block is estimated, in a rig with this number of
// cameras without optional blocks.
std::vector<ParameterGroup> DefaultGroups(
    const std::vector<BlockSetting>& blocks = {}, int cameras = 1);
// The same for the blocks that theta has.
std::vector<ParameterGroup> DefaultGroups(
    const std::vector<BlockSetting>& blocks, const Calibration& theta);

// Adds to the factory calibration of a new rig each optional block that it
// lacks and that a setting says is estimated, with the value of a device
// without the effect. Which blocks a rig has never changes afterwards.
void AddEstimatedBlocks(const std::vector<BlockSetting>& blocks,
                        Calibration* theta);

// A value for all components that match a pattern.
struct ComponentSetting {
  std::string pattern;
  double value = 0;
};

// Criterion by which segments are kept.
enum class Selection {
  kTables,  // the paper's: for each group the segments of lowest entropy
  // One set for all of theta, selected by joint information (core/selection).
  kJointD,
  kJointA,
  kJointE,
};

// Name of the only table of a rig with a joint selection.
inline constexpr char kJointTable[] = "joint";

// Limits of an IMU's readings on each axis, in both directions; the defaults
// are 2000 deg/s and 16 g.
struct ImuFullScale {
  double gyro_radps = 34.9065850;
  double accel_mps2 = 156.9064;
};

struct Rig {
  std::string id;  // [a-z0-9_-]{1,63}
  Calibration factory;
  ImuNoise imu_noise;
  ImuFullScale imu_full_scale;
  // Those of the second IMU, if the rig has one.
  ImuNoise imu1_noise;
  ImuFullScale imu1_full_scale;
  double pixel_sigma_px = 1.0;
  double gravity_mps2 = 9.81;  // g = (0, 0, -gravity) in G
  std::vector<ParameterGroup> groups = DefaultGroups();
  // Prior standard deviations (factory tolerances) by component, in its unit;
  // later ones take precedence. Default: 10 sigma_ref, or what a block
  // declares.
  std::vector<ComponentSetting> prior_sigmas;
  // Mean of the prior, e.g. that of the devices of a cohort; nullopt: the
  // factory calibration. It has the shape of the factory calibration, and its
  // values in components that are not estimated. Read it by PriorMean.
  std::optional<Calibration> prior_mean = std::nullopt;
  // Patterns of components that are never estimated.
  std::vector<std::string> fixed;
  // Later ones take precedence. Default: as the blocks are declared.
  std::vector<BlockSetting> blocks;
  Selection selection = Selection::kTables;
  // N: the number of segments of a table. A joint set holds N for each group.
  int table_size = 8;
  // A segment enters a table only if its gain for the group is at least this.
  double min_gain_nats = 1.0;
  // After the first run, the next one starts when at least this fraction of the
  // table entries is new since the last run.
  double retrigger_fraction = 0.5;
  // Has no effect, since CalibrateOptions::reweight_noise is on; kept for rigs
  // that were stored with it.
  bool reweight_noise = false;
};

// Indices of the tangent components that match at least one pattern, sorted.
std::vector<int> MatchComponents(
    const std::vector<TangentComponent>& components,
    const std::vector<std::string>& patterns);

// Components of a group of this rig, sorted, without fixed ones.
std::vector<int> GroupComponents(const Rig& rig, const ParameterGroup& group);

// Components that are estimated (not fixed), sorted.
std::vector<int> FreeComponents(const Rig& rig);

// Nonzero for each camera whose time offset is estimated.
std::vector<char> EstimatedTimeOffsets(const Rig& rig);

// Mean of the prior on theta, about which PriorSigmas hold. The reference is
// valid as long as `rig` is.
const Calibration& PriorMean(const Rig& rig);

// Prior standard deviation of every tangent component, in its unit.
Eigen::VectorXd PriorSigmas(const Rig& rig);

// sigma_ref of every tangent component, in its unit.
Eigen::VectorXd ReferenceSigmas(const Rig& rig);

// Returns every violation: id, positive and finite numbers, unit quaternions,
// at least one camera, image sizes, distortion in range, groups that match
// nothing or share a name, patterns that match nothing, nothing estimated.
// Names of groups follow the rules of the id, and a group has at least one
// component that is not fixed; with a joint selection, no group has the name of
// its table. A prior mean is a valid calibration with the shape and the images
// of the factory calibration, and equal to it in components that are not
// estimated. Paths of the calibrations begin with "factory" and "prior_mean".
std::vector<Violation> Validate(const Rig& rig);

// Applies the same rules to a calibration alone; paths begin with `prefix` and
// a dot, unless `prefix` is empty.
std::vector<Violation> Validate(const Calibration& theta,
                                const std::string& prefix);

}  // namespace selfcal
