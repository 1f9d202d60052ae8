#include "client/cli/rig_options.h"

#include "client/cli/positive_number.h"

namespace selfcal::client {
namespace {

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
  create->add_option("--imu1-preset",
                     input->imu1_preset,
                     "The same for the second IMU of the file");
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

}  // namespace

std::vector<FieldOption> AddRigOverrides(CLI::App* create,
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

}  // namespace selfcal::client
