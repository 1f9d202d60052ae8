// rig create.
#include <fmt/format.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/foreign_files.h"
#include "client/cli/positive_number.h"
#include "client/cli/rig_input.h"
#include "client/cli/rig_text.h"
#include "selfcal/v1/rig.grpc.pb.h"

namespace selfcal::client {
namespace {

using RigService = v1::RigService::StubInterface;

// An option, and the field of the request that it sets.
using FieldOption = std::pair<const char*, const CLI::Option*>;

// Names the flags of the last elements of a list, which they have added.
void NameElements(const std::string& field,
                  int size,
                  const std::string& flag,
                  const std::vector<std::string>& values,
                  FlagNames* flags) {
  const int first = size - static_cast<int>(values.size());
  for (int i = first; i < size; ++i) {
    (*flags)[fmt::format("{}[{}]", field, i)] =
        fmt::format("{} {}", flag, values[static_cast<std::size_t>(i - first)]);
  }
}

int Create(Context* context, const RigInput& input) {
  std::vector<Loss> losses;
  const auto rig = ReadRig(input, &losses);
  PrintLosses(losses);
  if (!rig.ok()) return FailInput(rig.status());
  const auto stub = v1::RigService::NewStub(context->Channel());
  v1::CreateRigRequest request;
  *request.mutable_rig() = *rig;
  FlagNames* const flags = &context->flags;
  NameElements("rig.prior_sigmas",
               rig->prior_sigmas_size(),
               "--prior-sigma",
               input.prior_sigmas,
               flags);
  NameElements("rig.fixed", rig->fixed_size(), "--fixed", input.fixed, flags);
  NameElements(
      "rig.blocks", rig->blocks_size(), "--block", input.blocks, flags);
  v1::Rig created;
  const auto status =
      Call<RigService>(stub.get(), &RigService::CreateRig, request, &created);
  if (!status.ok()) return Fail(*context, status);
  PrintRig(*context, created);
  return kDone;
}

// Names the fields that options set on this command line.
void NameFlags(const std::vector<FieldOption>& options, Context* context) {
  for (const auto& [field, option] : options) {
    if (option->count() > 0) context->flags[field] = option->get_name();
  }
}

// Two forms of one density: as data sheets state it, or of readings.
std::vector<FieldOption> AddDensityOptions(CLI::App* create,
                                           CLI::Option* imu_rate,
                                           RigInput* input) {
  CLI::Option* const gyro =
      create->add_option("--gyro-noise",
                         input->gyro_noise,
                         "Noise density, as in data sheets and for Kalibr "
                         "[rad/s/sqrt(Hz)]");
  CLI::Option* const accel = create->add_option(
      "--accel-noise", input->accel_noise, "The same [m/s^2/sqrt(Hz)]");
  CLI::Option* const gyro_rms =
      create
          ->add_option("--gyro-noise-rms",
                       input->gyro_noise_rms,
                       "Instead of the density: standard deviation of single "
                       "readings at rest, at --imu-rate, with a filter that "
                       "passes half that rate [rad/s]")
          ->check(AboveZero())
          ->needs(imu_rate)
          ->excludes(gyro);
  CLI::Option* const accel_rms =
      create
          ->add_option(
              "--accel-noise-rms", input->accel_noise_rms, "The same [m/s^2]")
          ->check(AboveZero())
          ->needs(imu_rate)
          ->excludes(accel);
  return {{"rig.imu_noise.gyro_noise_density", gyro},
          {"rig.imu_noise.gyro_noise_density", gyro_rms},
          {"rig.imu_noise.accel_noise_density", accel},
          {"rig.imu_noise.accel_noise_density", accel_rms}};
}

std::vector<FieldOption> AddNoiseOptions(CLI::App* create, RigInput* input) {
  return {
      {"rig.pixel_sigma_px",
       create->add_option("--pixel-sigma", input->pixel_sigma_px, "[px]")},
      {"rig.imu_noise.gyro_bias_random_walk",
       create->add_option(
           "--gyro-bias-walk", input->gyro_bias_walk, "[rad/s^2/sqrt(Hz)]")},
      {"rig.imu_noise.accel_bias_random_walk",
       create->add_option(
           "--accel-bias-walk", input->accel_bias_walk, "[m/s^3/sqrt(Hz)]")},
      {"rig.imu.gyro_max",
       create->add_option("--gyro-max",
                          input->gyro_max,
                          "Full scale of the gyroscope, beyond which readings "
                          "are left out [rad/s]; by default that of "
                          "--imu-preset, or 2000 deg/s")},
      {"rig.imu.accel_max",
       create->add_option("--accel-max",
                          input->accel_max,
                          "Full scale of the accelerometer [m/s^2]; by "
                          "default that of --imu-preset, or 16 g")},
      {"rig.gravity_mps2",
       create->add_option("--gravity", input->gravity_mps2, "[m/s^2]")}};
}

std::vector<FieldOption> AddPolicyOptions(CLI::App* create, RigInput* input) {
  return {
      {"rig.selection",
       create->add_option("--selection",
                          input->selection,
                          "Criterion by which segments are kept: tables, "
                          "joint-d, joint-a or joint-e")},
      {"rig.table_size",
       create->add_option("--table-size",
                          input->table_size,
                          "Capacity of a table, in segments")},
      {"rig.min_gain_nats",
       create->add_option("--min-gain",
                          input->min_gain_nats,
                          "Minimum gain of a segment to enter a table [nat]")},
      {"rig.retrigger_fraction",
       create->add_option("--retrigger-fraction",
                          input->retrigger_fraction,
                          "Fraction of the table entries that must be new to "
                          "trigger another run")},
      {"rig.table_max_age",
       create->add_option("--table-max-age",
                          input->table_max_age_s,
                          "Age at which segments leave the tables, since their "
                          "arrival [s]")},
      {"rig.recalibration_min_interval",
       create->add_option("--min-interval",
                          input->min_interval_s,
                          "Minimum time between the end of a run and the next, "
                          "except for manual runs [s]")},
      {"rig.calibration_max_age",
       create->add_option(
           "--calibration-max-age",
           input->calibration_max_age_s,
           "Age of the active version that triggers a run [s]")}};
}

void AddImuOptions(CLI::App* create, RigInput* input) {
  create->add_option("--imu-preset",
                     input->imu_preset,
                     "Noise, full scale and tolerances of this part, e.g. "
                     "bmi088, instead of those of the file; other options "
                     "take precedence; `selfcal rig presets` lists the parts");
  create->add_option("--imu",
                     input->imu,
                     "Tolerances of the IMU: consumer (scales to 2 %, angles "
                     "to 1 degree), factory-calibrated (0.3 %, 0.1 degrees) or "
                     "unknown; prior sigmas in the file take precedence");
}

std::vector<FieldOption> AddComponentOptions(CLI::App* create,
                                             RigInput* input) {
  create
      ->add_option("--prior-sigma",
                   input->prior_sigmas,
                   "COMPONENT=VALUE: prior sigma of the component, or of all "
                   "of a block such as imu.gyro.scale; a '*' at either end "
                   "matches anything; takes precedence over the file and "
                   "--imu; repeatable")
      ->allow_extra_args(false);
  create->add_flag("--reweight-noise",
                   input->reweight_noise,
                   "Has no effect: runs always weight by the noise that their "
                   "residuals show");
  create->add_option("--fixed",
                     input->fixed,
                     "Never estimate components with this name; a '*' at "
                     "either end matches anything; repeatable");
  create->add_option("--block",
                     input->blocks,
                     "NAME=on to estimate the parameter blocks with this name, "
                     "NAME=off to hold them at their factory value; a '*' at "
                     "either end matches anything; repeatable");
  return {{"rig.estimate_time_offset",
           create->add_flag("--estimate-time-offset",
                            input->estimate_time_offset,
                            "The same as --block '*.time_offset=on'")}};
}

std::vector<FieldOption> AddOverrides(CLI::App* create,
                                      CLI::Option* imu_rate,
                                      RigInput* input) {
  AddImuOptions(create, input);
  std::vector<FieldOption> options = {
      {"rig.name",
       create->add_option(
           "--id", input->id, "Id of the rig, instead of that in the file")}};
  for (const auto& more : {AddDensityOptions(create, imu_rate, input),
                           AddNoiseOptions(create, input),
                           AddPolicyOptions(create, input),
                           AddComponentOptions(create, input)}) {
    options.insert(options.end(), more.begin(), more.end());
  }
  return options;
}

}  // namespace

void AddRigCreation(CLI::App* rig, Context* context) {
  CLI::App* create = rig->add_subcommand(
      "create", "Create a rig; its factory calibration becomes version 1");
  const auto input = std::make_shared<RigInput>();
  CLI::Option* const files = create->add_option(
      "FILE",
      input->files,
      "selfcal.v1.Rig in proto3 JSON, - is standard input; with --from, the "
      "files of that tool");
  create
      ->add_option(
          "--vi-map", input->vi_map, "Take the rig from this maplab VI-map")
      ->excludes(files);
  CLI::Option* const from =
      create
          ->add_option("--from",
                       input->from,
                       "Take the calibration from files of this tool")
          ->check(FormatNames())
          ->needs(files);
  create
      ->add_option("--extrinsics",
                   input->extrinsics,
                   "With --from: pose of a camera, as "
                   "cam0=PX,PY,PZ,QX,QY,QZ,QW: the transform that takes points "
                   "from the IMU's frame to the camera's (z forward), as tf "
                   "shows it; repeatable")
      ->allow_extra_args(false)
      ->needs(from);
  CLI::Option* const imu_rate =
      create
          ->add_option("--imu-rate",
                       input->imu_rate_hz,
                       "Rate of the IMU, for noise that is stated per reading: "
                       "by tools (--from), --gyro-noise-rms and "
                       "--accel-noise-rms [Hz]")
          ->check(AboveZero());
  create
      ->add_option("--cameras",
                   input->cameras,
                   "With --from or --vi-map: only these cameras, e.g. "
                   "cam0,cam2; they are numbered anew [all]")
      ->delimiter(',')
      ->allow_extra_args(false);
  create->add_flag("--strict",
                   input->strict,
                   "With --from: create no rig if the predictions of the tool "
                   "differ from those of selfcal");
  const auto options = AddOverrides(create, imu_rate, input.get());
  create->callback([context, input, options] {
    if (input->files.empty() && input->vi_map.empty()) {
      throw CLI::RequiredError("FILE, --from FORMAT FILE... or --vi-map DIR");
    }
    if (!input->id && !(input->from.empty() && input->vi_map.empty())) {
      throw CLI::ValidationError(
          "--id",
          fmt::format("is required with {}, whose files do not name the rig",
                      input->from.empty() ? "--vi-map" : "--from"));
    }
    NameFlags(options, context);
    context->command = [context, input] { return Create(context, *input); };
  });
}

}  // namespace selfcal::client
