#include <utility>

#include "core/model/too_many.h"
#include "proto/convert.h"
#include "proto/resource_names.h"

namespace selfcal {
namespace {

ImuNoise Value(const v1::ImuNoise& message) {
  return {message.gyro_noise_density(),
          message.accel_noise_density(),
          message.gyro_bias_random_walk(),
          message.accel_bias_random_walk()};
}

std::string TimeOffsetOf(int camera) {
  return "cam" + std::to_string(camera) + ".time_offset";
}

// Camera whose time offset is not estimated; none: the number of cameras.
int FirstWithoutTimeOffset(const std::vector<BlockSetting>& blocks,
                           int cameras) {
  int camera = 0;
  while (camera < cameras && IsEstimated(blocks, TimeOffsetOf(camera))) {
    ++camera;
  }
  return camera;
}

// Reads the blocks, with the older flag for time offsets in the same form.
void ReadBlocks(const v1::Rig& message,
                const std::string& prefix,
                Rig* rig,
                std::vector<Violation>* violations) {
  if (static_cast<std::size_t>(message.blocks_size()) > kMaxPatterns) {
    violations->push_back(
        {prefix + "blocks", TooMany(message.blocks().size(), kMaxPatterns)});
    return;
  }
  for (const v1::BlockSetting& setting : message.blocks()) {
    if (setting.state() != v1::BlockSetting::ON &&
        setting.state() != v1::BlockSetting::OFF) {
      violations->push_back(
          {prefix + "blocks[" + std::to_string(rig->blocks.size()) + "].state",
           "is missing or unknown; send ON or OFF"});
    }
    rig->blocks.push_back(
        {setting.pattern(), setting.state() == v1::BlockSetting::ON});
  }
  if (!message.estimate_time_offset()) return;
  const int cameras = static_cast<int>(rig->factory.cameras.size());
  if (FirstWithoutTimeOffset(rig->blocks, cameras) == cameras) return;
  rig->blocks.insert(rig->blocks.begin(), {"*.time_offset", true});
  const int off = FirstWithoutTimeOffset(rig->blocks, cameras);
  if (off == cameras) return;
  violations->push_back({prefix + "estimate_time_offset",
                         "contradicts blocks, which switch " +
                             TimeOffsetOf(off) + " off; send blocks alone"});
}

std::vector<ParameterGroup> ReadGroups(const v1::Rig& message, const Rig& rig) {
  if (message.groups().empty()) {
    return DefaultGroups(rig.blocks, rig.factory);
  }
  std::vector<ParameterGroup> groups;
  for (const v1::ParameterGroup& group : message.groups()) {
    groups.push_back(
        {group.group(), {group.patterns().begin(), group.patterns().end()}});
  }
  return groups;
}

std::vector<ComponentSetting> ReadPriorSigmas(const v1::Rig& message) {
  std::vector<ComponentSetting> settings;
  for (const v1::ComponentSetting& setting : message.prior_sigmas()) {
    settings.push_back({setting.pattern(), setting.value()});
  }
  return settings;
}

v1::Rig::Selection ToProto(Selection selection) {
  switch (selection) {
    case Selection::kTables:
      return v1::Rig::TABLES;
    case Selection::kJointD:
      return v1::Rig::JOINT_D;
    case Selection::kJointA:
      return v1::Rig::JOINT_A;
    case Selection::kJointE:
      return v1::Rig::JOINT_E;
  }
  return v1::Rig::SELECTION_UNSPECIFIED;
}

// Reads the selection; leaves it unchanged if the message does not specify it.
// Returns false if it is unknown.
bool ReadSelection(const v1::Rig& message, Selection* selection) {
  switch (message.selection()) {
    case v1::Rig::SELECTION_UNSPECIFIED:
      return true;
    case v1::Rig::TABLES:
      *selection = Selection::kTables;
      return true;
    case v1::Rig::JOINT_D:
      *selection = Selection::kJointD;
      return true;
    case v1::Rig::JOINT_A:
      *selection = Selection::kJointA;
      return true;
    case v1::Rig::JOINT_E:
      *selection = Selection::kJointE;
      return true;
    default:
      return false;
  }
}

void ReadFullScale(const v1::ImuFullScale& message, ImuFullScale* full_scale) {
  if (message.gyro_max() != 0) full_scale->gyro_radps = message.gyro_max();
  if (message.accel_max() != 0) full_scale->accel_mps2 = message.accel_max();
}

void Fill(const ImuNoise& noise, v1::ImuNoise* message) {
  message->set_gyro_noise_density(noise.gyro_noise_density);
  message->set_accel_noise_density(noise.accel_noise_density);
  message->set_gyro_bias_random_walk(noise.gyro_bias_random_walk);
  message->set_accel_bias_random_walk(noise.accel_bias_random_walk);
}

void Fill(const ImuFullScale& full_scale, v1::ImuFullScale* message) {
  message->set_gyro_max(full_scale.gyro_radps);
  message->set_accel_max(full_scale.accel_mps2);
}

// Reads the noise of the second IMU, which a rig with one must state, and no
// other may.
void ReadSecondImu(const v1::Rig& message,
                   const std::string& prefix,
                   Rig* rig,
                   std::vector<Violation>* violations) {
  if (rig->factory.imu1) {
    if (message.has_imu1_noise()) {
      rig->imu1_noise = Value(message.imu1_noise());
    } else {
      violations->push_back({prefix + "imu1_noise", "is missing"});
    }
    return;
  }
  for (const auto& [present, field] :
       {std::pair(message.has_imu1_noise(), "imu1_noise"),
        std::pair(message.has_imu1(), "imu1")}) {
    if (!present) continue;
    violations->push_back(
        {prefix + field,
         "is that of a second IMU, which factory.imu1 of this rig lacks"});
  }
}

// Reads the settings. The default is stated by 0 or, if 0 has a meaning, by an
// absent field.
void ReadSettings(const v1::Rig& message, Rig* rig) {
  rig->pixel_sigma_px = message.pixel_sigma_px();
  if (message.gravity_mps2() != 0) rig->gravity_mps2 = message.gravity_mps2();
  if (message.table_size() != 0) rig->table_size = message.table_size();
  rig->reweight_noise = message.reweight_noise();
  ReadFullScale(message.imu(), &rig->imu_full_scale);
  ReadFullScale(message.imu1(), &rig->imu1_full_scale);
  if (message.has_min_gain_nats()) rig->min_gain_nats = message.min_gain_nats();
  if (message.has_retrigger_fraction()) {
    rig->retrigger_fraction = message.retrigger_fraction();
  }
}

}  // namespace

v1::Rig ToProto(const Rig& rig) {
  v1::Rig message;
  message.set_name(RigName(rig.id));
  *message.mutable_factory() = ToProto(rig.factory);
  Fill(rig.imu_noise, message.mutable_imu_noise());
  Fill(rig.imu_full_scale, message.mutable_imu());
  if (rig.factory.imu1) {
    Fill(rig.imu1_noise, message.mutable_imu1_noise());
    Fill(rig.imu1_full_scale, message.mutable_imu1());
  }
  message.set_pixel_sigma_px(rig.pixel_sigma_px);
  message.set_gravity_mps2(rig.gravity_mps2);
  for (const ParameterGroup& group : rig.groups) {
    v1::ParameterGroup* added = message.add_groups();
    added->set_group(group.name);
    added->mutable_patterns()->Add(group.patterns.begin(),
                                   group.patterns.end());
  }
  for (const ComponentSetting& setting : rig.prior_sigmas) {
    v1::ComponentSetting* added = message.add_prior_sigmas();
    added->set_pattern(setting.pattern);
    added->set_value(setting.value);
  }
  if (rig.prior_mean) {
    *message.mutable_prior_mean() = ToProto(*rig.prior_mean);
  }
  message.mutable_fixed()->Add(rig.fixed.begin(), rig.fixed.end());
  message.set_selection(ToProto(rig.selection));
  message.set_table_size(rig.table_size);
  message.set_min_gain_nats(rig.min_gain_nats);
  message.set_retrigger_fraction(rig.retrigger_fraction);
  for (const BlockSetting& setting : rig.blocks) {
    v1::BlockSetting* added = message.add_blocks();
    added->set_pattern(setting.pattern);
    added->set_state(setting.estimated ? v1::BlockSetting::ON
                                       : v1::BlockSetting::OFF);
  }
  const int cameras = static_cast<int>(rig.factory.cameras.size());
  message.set_estimate_time_offset(
      cameras > 0 && FirstWithoutTimeOffset(rig.blocks, cameras) == cameras);
  message.set_reweight_noise(rig.reweight_noise);
  return message;
}

std::vector<Violation> FromProto(const v1::Rig& message,
                                 const std::string& prefix,
                                 Rig* rig) {
  std::vector<Violation> violations;
  Rig read;
  if (const auto id = ParseRigName(message.name())) {
    read.id = *id;
  } else {
    violations.push_back(
        {prefix + "name",
         "send rigs/{rig}, {rig} of 1 to 63 characters of a-z, 0-9, _ and -"});
  }
  if (message.has_factory()) {
    auto more =
        FromProto(message.factory(), prefix + "factory.", &read.factory);
    violations.insert(violations.end(), more.begin(), more.end());
  } else {
    violations.push_back({prefix + "factory", "is missing"});
  }
  if (message.has_prior_mean()) {
    auto more = FromProto(message.prior_mean(),
                          prefix + "prior_mean.",
                          &read.prior_mean.emplace());
    violations.insert(violations.end(), more.begin(), more.end());
  }
  if (message.has_imu_noise()) {
    read.imu_noise = Value(message.imu_noise());
  } else {
    violations.push_back({prefix + "imu_noise", "is missing"});
  }
  ReadSecondImu(message, prefix, &read, &violations);
  if (!ReadSelection(message, &read.selection)) {
    violations.push_back(
        {prefix + "selection",
         std::to_string(static_cast<int>(message.selection())) +
             " is unknown; send TABLES, JOINT_D, JOINT_A or JOINT_E"});
  }
  ReadSettings(message, &read);
  ReadBlocks(message, prefix, &read, &violations);
  read.groups = ReadGroups(message, read);
  read.prior_sigmas = ReadPriorSigmas(message);
  read.fixed.assign(message.fixed().begin(), message.fixed().end());
  if (violations.empty()) *rig = std::move(read);
  return violations;
}

}  // namespace selfcal
