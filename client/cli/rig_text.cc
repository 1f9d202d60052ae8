#include "client/cli/rig_text.h"

#include <fmt/format.h>

#include <cctype>
#include <string>
#include <string_view>
#include <vector>

#include "client/cli/rig_input.h"
#include "client/text/text.h"
#include "core/model/calibration.h"
#include "proto/convert.h"

namespace selfcal::client {
namespace {

std::string CameraText(const v1::CameraCalibration& camera) {
  std::string model = v1::DistortionModel_Name(camera.distortion_model());
  constexpr std::string_view kPrefix = "DISTORTION_MODEL_";
  if (model.rfind(kPrefix, 0) == 0) model.erase(0, kPrefix.size());
  for (char& c : model) {
    c = c == '_' ? '-' : static_cast<char>(std::tolower(c));
  }
  return fmt::format(
      "{} x {} px, {}", camera.width_px(), camera.height_px(), model);
}

std::string GroupText(const v1::ParameterGroup& group) {
  return fmt::format("{}: {}", group.group(), fmt::join(group.patterns(), " "));
}

std::string SecondsText(const google::protobuf::Duration& duration) {
  return fmt::format(
      "{:g} s",
      static_cast<double>(duration.seconds()) + 1e-9 * duration.nanos());
}

void AddPolicy(const v1::Rig& rig, Facts* facts) {
  if (rig.has_table_max_age()) {
    facts->Add("table maximum age", SecondsText(rig.table_max_age()));
  }
  if (rig.has_recalibration_min_interval()) {
    facts->Add("minimum interval",
               SecondsText(rig.recalibration_min_interval()));
  }
  if (rig.has_calibration_max_age()) {
    facts->Add("calibration maximum age",
               SecondsText(rig.calibration_max_age()));
  }
}

void AddImu(const std::string& which,
            const v1::ImuNoise& noise,
            const v1::ImuFullScale& full_scale,
            Facts* facts) {
  facts->Add(which + "gyro noise",
             fmt::format("{:g} rad/s/sqrt(Hz)", noise.gyro_noise_density()));
  facts->Add(which + "accel noise",
             fmt::format("{:g} m/s^2/sqrt(Hz)", noise.accel_noise_density()));
  facts->Add(
      which + "gyro bias walk",
      fmt::format("{:g} rad/s^2/sqrt(Hz)", noise.gyro_bias_random_walk()));
  facts->Add(
      which + "accel bias walk",
      fmt::format("{:g} m/s^3/sqrt(Hz)", noise.accel_bias_random_walk()));
  facts->Add(which + "gyro full scale",
             fmt::format("{:g} rad/s", full_scale.gyro_max()));
  facts->Add(which + "accel full scale",
             fmt::format("{:g} m/s^2", full_scale.accel_max()));
}

void AddReports(const v1::ReportState& reports, Facts* facts) {
  facts->Add("last report", TimeText(reports.time()));
  facts->Add("records waiting then", fmt::format("{}", reports.waiting()));
  facts->Add("device program", reports.program_version());
}

Facts Describe(const v1::Rig& rig,
               const std::optional<v1::ReportState>& reports) {
  Facts facts;
  facts.Add("rig", LastPart(rig.name()));
  facts.Add("created", TimeText(rig.create_time()));
  if (reports) AddReports(*reports, &facts);
  for (const auto& camera : rig.factory().cameras()) {
    facts.Add("camera", CameraText(camera));
  }
  AddImu("", rig.imu_noise(), rig.imu(), &facts);
  if (rig.factory().has_imu1()) {
    AddImu("second ", rig.imu1_noise(), rig.imu1(), &facts);
  }
  facts.Add("pixel sigma", fmt::format("{:g} px", rig.pixel_sigma_px()));
  facts.Add("gravity", fmt::format("{:g} m/s^2", rig.gravity_mps2()));
  for (const auto& group : rig.groups()) {
    facts.Add("group", GroupText(group));
  }
  for (const auto& prior : rig.prior_sigmas()) {
    facts.Add("prior sigma",
              fmt::format("{}: {:g}", prior.pattern(), prior.value()));
  }
  for (const auto& walk : rig.walk_densities()) {
    facts.Add(
        "walk density",
        fmt::format("{}: {:g} / sqrt(day)", walk.pattern(), walk.value()));
  }
  for (const auto& pattern : rig.fixed()) facts.Add("fixed", pattern);
  for (const auto& block : rig.blocks()) {
    facts.Add(
        "block",
        fmt::format("{}: {}",
                    block.pattern(),
                    block.state() == v1::BlockSetting::ON ? "on" : "off"));
  }
  facts.Add("time offset", rig.estimate_time_offset() ? "estimated" : "known");
  facts.Add("selection", SelectionText(rig.selection()));
  facts.Add("table size", fmt::format("{}", rig.table_size()));
  facts.Add("minimum gain", fmt::format("{:g} nat", rig.min_gain_nats()));
  facts.Add("retrigger fraction",
            fmt::format("{:g}", rig.retrigger_fraction()));
  AddPolicy(rig, &facts);
  return facts;
}

// The factory values, beside them the prior mean if the rig has one. Empty if
// the message is invalid.
Table FactoryValues(const v1::Rig& rig) {
  std::vector<Column> columns = {{"factory"}, {"value", true}, {"unit"}};
  if (rig.has_prior_mean()) columns.push_back({"prior mean", true});
  Table table(columns);
  Calibration theta;
  Calibration mean;
  if (!FromProto(rig.factory(), "", &theta).empty() ||
      (rig.has_prior_mean() &&
       (!FromProto(rig.prior_mean(), "", &mean).empty() ||
        !SameShape(mean, theta)))) {
    return table;
  }
  const auto components = TangentComponents(theta);
  const Eigen::VectorXd values = ReadableValues(theta);
  const Eigen::VectorXd means =
      rig.has_prior_mean() ? ReadableValues(mean) : Eigen::VectorXd();
  for (std::size_t i = 0; i < components.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    table.Add({components[i].name,
               ValueText(values[k], 0),
               components[i].unit,
               k < means.size() ? ValueText(means[k], 0) : ""});
  }
  return table;
}

}  // namespace

void PrintRig(const Context& context,
              const v1::Rig& rig,
              const std::optional<v1::ReportState>& reports) {
  if (context.json) return context.PrintJson(rig);
  context.Print(Describe(rig, reports));
  if (context.terminal) PrintText("\n");
  context.Print(FactoryValues(rig));
}

}  // namespace selfcal::client
