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
#include "client/cli/rig_options.h"
#include "client/cli/rig_text.h"
#include "selfcal/v1/rig.grpc.pb.h"

namespace selfcal::client {
namespace {

using RigService = v1::RigService::StubInterface;

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
  const auto options = AddRigOverrides(create, imu_rate, input.get());
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
