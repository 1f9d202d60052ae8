// rig update: of one rig, or of all rigs of a filter.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <google/protobuf/util/field_mask_util.h>
#include <google/protobuf/util/message_differencer.h>
#include <google/protobuf/util/time_util.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/cli/bulk.h"
#include "client/cli/commands.h"
#include "client/cli/component_settings.h"
#include "client/cli/instruction.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/rig.grpc.pb.h"

namespace selfcal::client {
namespace {

using google::protobuf::util::FieldMaskUtil;
using google::protobuf::util::MessageDifferencer;
using google::protobuf::util::TimeUtil;
using RigService = v1::RigService::StubInterface;

struct UpdateOptions {
  std::string rig;  // empty: those of the filter
  BulkOptions bulk;
  std::vector<std::string> labels;  // name=value
  std::vector<std::string> removed_labels;
  bool clear_prior_mean = false;
  std::vector<std::string> prior_sigmas;    // pattern=value
  std::vector<std::string> walk_densities;  // pattern=value
  std::optional<double> min_gain_nats;
  std::optional<double> retrigger_fraction;
  std::optional<double> table_max_age_s;
  std::optional<double> min_interval_s;
  std::optional<double> calibration_max_age_s;
  std::optional<double> gyro_max;
  std::optional<double> accel_max;
};

void SetSeconds(const std::optional<double>& seconds,
                const char* field,
                google::protobuf::Duration* duration,
                v1::UpdateRigRequest* request) {
  if (!seconds) return;
  *duration = TimeUtil::NanosecondsToDuration(
      static_cast<std::int64_t>(*seconds * 1e9));
  request->mutable_update_mask()->add_paths(field);
}

// Applies the options to the labels of the rig as it is.
absl::Status ReadLabels(const UpdateOptions& options,
                        const v1::Rig& rig,
                        v1::UpdateRigRequest* request) {
  if (options.labels.empty() && options.removed_labels.empty()) {
    return absl::OkStatus();
  }
  auto& labels = *request->mutable_rig()->mutable_labels();
  labels = rig.labels();
  for (const std::string& text : options.labels) {
    const auto pair = SplitPair(text);
    if (!pair) return NotAPair("--label", text, "NAME=VALUE");
    labels[pair->first] = pair->second;
  }
  for (const std::string& name : options.removed_labels) labels.erase(name);
  request->mutable_update_mask()->add_paths("labels");
  return absl::OkStatus();
}

absl::Status ReadComponents(
    const std::string& flag,
    const std::vector<std::string>& texts,
    const v1::Rig& rig,
    google::protobuf::RepeatedPtrField<v1::ComponentSetting>* settings) {
  const absl::Status status = ReadSettings(flag, texts, settings);
  return status.ok() ? NameComponents(flag, rig, settings) : status;
}

absl::Status ReadRequest(const UpdateOptions& options,
                         const v1::Rig& rig,
                         v1::UpdateRigRequest* request) {
  v1::Rig* update = request->mutable_rig();
  update->set_name(rig.name());
  auto* mask = request->mutable_update_mask();
  absl::Status status = ReadLabels(options, rig, request);
  if (!status.ok()) return status;
  if (options.clear_prior_mean) mask->add_paths("prior_mean");
  if (!options.prior_sigmas.empty()) mask->add_paths("prior_sigmas");
  status = ReadComponents("--prior-sigma",
                          options.prior_sigmas,
                          rig,
                          update->mutable_prior_sigmas());
  if (!status.ok()) return status;
  if (!options.walk_densities.empty()) mask->add_paths("walk_densities");
  status = ReadComponents("--walk-density",
                          options.walk_densities,
                          rig,
                          update->mutable_walk_densities());
  if (!status.ok()) return status;
  if (options.min_gain_nats) {
    update->set_min_gain_nats(*options.min_gain_nats);
    mask->add_paths("min_gain_nats");
  }
  if (options.retrigger_fraction) {
    update->set_retrigger_fraction(*options.retrigger_fraction);
    mask->add_paths("retrigger_fraction");
  }
  SetSeconds(options.table_max_age_s,
             "table_max_age",
             update->mutable_table_max_age(),
             request);
  SetSeconds(options.min_interval_s,
             "recalibration_min_interval",
             update->mutable_recalibration_min_interval(),
             request);
  SetSeconds(options.calibration_max_age_s,
             "calibration_max_age",
             update->mutable_calibration_max_age(),
             request);
  if (options.gyro_max || options.accel_max) {
    v1::ImuFullScale* const imu = update->mutable_imu();
    *imu = rig.imu();
    if (options.gyro_max) imu->set_gyro_max(*options.gyro_max);
    if (options.accel_max) imu->set_accel_max(*options.accel_max);
    mask->add_paths("imu");
  }
  if (mask->paths().empty()) {
    return absl::InvalidArgumentError(
        "nothing to change; `selfcal rig update --help` lists what can be");
  }
  return absl::OkStatus();
}

int UpdateOne(Context* context, const UpdateOptions& options) {
  const auto stub = v1::RigService::NewStub(context->Channel());
  v1::GetRigRequest get;
  get.set_name(RigName(options.rig));
  v1::Rig rig;
  auto status = Call<RigService>(stub.get(), &RigService::GetRig, get, &rig);
  if (!status.ok()) return Fail(*context, status);
  v1::UpdateRigRequest request;
  const absl::Status read = ReadRequest(options, rig, &request);
  if (!read.ok()) return FailInput(read);
  context->flags.merge(
      FlagNames{{"rig.name", "RIG"},
                {"rig.labels", "--label"},
                {"rig.prior_sigmas", "--prior-sigma"},
                {"rig.walk_densities", "--walk-density"},
                {"rig.min_gain_nats", "--min-gain"},
                {"rig.retrigger_fraction", "--retrigger-fraction"},
                {"rig.table_max_age", "--table-max-age"},
                {"rig.recalibration_min_interval", "--min-interval"},
                {"rig.calibration_max_age", "--calibration-max-age"},
                {"rig.imu.gyro_max", "--gyro-max"},
                {"rig.imu.accel_max", "--accel-max"}});
  status = Call<RigService>(stub.get(), &RigService::UpdateRig, request, &rig);
  v1::Instruction instruction;
  *instruction.mutable_update_rig() = request;
  if (const auto code = EndFailed(status, *context, options.rig, instruction)) {
    return *code;
  }
  if (context->json) {
    context->PrintJson(rig);
    return kDone;
  }
  Facts facts;
  for (const std::string& field : request.update_mask().paths()) {
    facts.Add("changed", field);
  }
  context->Print(facts);
  return kDone;
}

struct Plan {
  v1::UpdateRigRequest request;
  v1::Rig after;  // the rig, with its changes
};

// Leaves out the rigs that are so already.
absl::Status MakePlans(const UpdateOptions& options,
                       const std::vector<v1::Rig>& rigs,
                       std::vector<Plan>* plans) {
  FieldMaskUtil::MergeOptions replace;
  replace.set_replace_message_fields(true);
  replace.set_replace_repeated_fields(true);
  for (const v1::Rig& rig : rigs) {
    Plan plan;
    const absl::Status read = ReadRequest(options, rig, &plan.request);
    if (!read.ok()) {
      return absl::Status(
          read.code(),
          fmt::format("{}: {}", rig.name(), std::string(read.message())));
    }
    plan.after = rig;
    FieldMaskUtil::MergeMessageTo(
        plan.request.rig(), plan.request.update_mask(), replace, &plan.after);
    if (!MessageDifferencer::Equals(rig, plan.after)) {
      plans->push_back(std::move(plan));
    }
  }
  return absl::OkStatus();
}

// Prints the rigs alone with --json, one by one.
void PrintPlans(const Context& context, const std::vector<Plan>& plans) {
  if (context.json) {
    for (const Plan& plan : plans) context.PrintJson(plan.after);
    return;
  }
  Table table({{"rig"}, {"changes"}});
  for (const Plan& plan : plans) {
    table.Add({LastPart(plan.after.name()),
               fmt::format(
                   "{}", fmt::join(plan.request.update_mask().paths(), ", "))});
  }
  context.Print(table);
}

std::vector<BulkChange> ChangesOf(RigService* stub,
                                  const std::vector<Plan>& plans) {
  std::vector<BulkChange> changes;
  for (const Plan& plan : plans) {
    changes.push_back(UpdateOf(stub, plan.request));
  }
  return changes;
}

int UpdateAll(Context* context, const UpdateOptions& options) {
  std::vector<v1::Rig> rigs;
  const grpc::Status status = ReadRigs(*context, options.bulk.filter, &rigs);
  if (!status.ok()) return Fail(*context, status);
  std::vector<Plan> plans;
  const absl::Status planned = MakePlans(options, rigs, &plans);
  if (!planned.ok()) return FailInput(planned);
  PrintPlans(*context, plans);
  const auto stub = v1::RigService::NewStub(context->Channel());
  return CarryOut(*context,
                  options.bulk,
                  {"Change", "changed"},
                  ChangesOf(stub.get(), plans));
}

int Update(Context* context, const UpdateOptions& options) {
  if (!options.bulk.filter.empty()) return UpdateAll(context, options);
  if (!options.rig.empty()) return UpdateOne(context, options);
  return FailInput(absl::InvalidArgumentError(
      "name a rig, or the rigs of a filter (--filter)"));
}

}  // namespace

void AddRigUpdate(CLI::App* rig, Context* context) {
  const auto options = std::make_shared<UpdateOptions>();
  CLI::App* update = rig->add_subcommand(
      "update",
      "Change the labels, tolerances or thresholds of a rig, or of all rigs of "
      "a filter");
  CLI::Option* one = update->add_option("RIG", options->rig);
  AddBulkOptions(update, &options->bulk)->excludes(one);
  update->add_option(
      "--label", options->labels, "NAME=VALUE: add or change; repeatable");
  update->add_option("--remove-label", options->removed_labels, "repeatable");
  update->add_flag("--clear-prior-mean",
                   options->clear_prior_mean,
                   "The mean of the prior is the factory calibration again");
  update->add_option("--prior-sigma",
                     options->prior_sigmas,
                     "COMPONENT=VALUE: replaces all prior sigmas; repeatable");
  update->add_option("--walk-density",
                     options->walk_densities,
                     "COMPONENT=VALUE [unit/sqrt(day)]: replaces all walk "
                     "densities; repeatable");
  update->add_option("--min-gain",
                     options->min_gain_nats,
                     "Minimum gain of a segment to enter a table [nat]");
  update->add_option("--retrigger-fraction",
                     options->retrigger_fraction,
                     "Fraction of the table entries that must be new to "
                     "trigger another run");
  update->add_option("--table-max-age",
                     options->table_max_age_s,
                     "Age at which segments leave the tables [s]; 0: none");
  update->add_option("--min-interval",
                     options->min_interval_s,
                     "Minimum time between runs [s]; 0: none");
  update->add_option("--calibration-max-age",
                     options->calibration_max_age_s,
                     "Age of the active version that triggers a run [s]; 0: "
                     "none");
  update->add_option("--gyro-max",
                     options->gyro_max,
                     "Full scale of the gyroscope [rad/s]; 0: the default");
  update->add_option("--accel-max",
                     options->accel_max,
                     "Full scale of the accelerometer [m/s^2]; 0: the default");
  update->callback([context, options] {
    context->command = [context, options] { return Update(context, *options); };
  });
}

}  // namespace selfcal::client
