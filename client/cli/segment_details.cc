// segments information, segments residuals: the information of one segment
// about each component, and what it leaves unexplained.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/positive_number.h"
#include "client/text/text.h"
#include "proto/resource_names.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {
namespace {

using SegmentService = v1::SegmentService::StubInterface;

struct SegmentOptions {
  std::string rig;
  std::string segment;
  std::int64_t version = 0;

  std::string name() const {
    return RigName(rig) + "/segments/" + LastPart(segment);
  }
};

int Information(Context* context, const SegmentOptions& options) {
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  v1::GetSegmentInformationRequest request;
  request.set_name(options.name());
  v1::SegmentInformation information;
  const auto status =
      Call<SegmentService>(stub.get(),
                           &SegmentService::GetSegmentInformation,
                           request,
                           &information);
  if (!status.ok()) return Fail(*context, status);
  if (context->json) {
    context->PrintJson(information);
    return kDone;
  }
  Table table({{"component"},
               {"unit"},
               {"prior sigma", true},
               {"sigma", true},
               {"ratio", true}});
  for (const auto& component : information.components()) {
    table.Add(
        {component.component(),
         component.unit(),
         fmt::format("{:.4g}", component.prior_sigma()),
         fmt::format("{:.4g}", component.sigma()),
         fmt::format("{:.4g}", component.sigma() / component.prior_sigma())});
  }
  context->Print(table);
  return kDone;
}

void AddInertialRms(const std::string& prefix,
                    const google::protobuf::RepeatedField<double>& rms,
                    Facts* facts) {
  constexpr const char* kKinds[] = {"rotation",
                                    "velocity",
                                    "position",
                                    "accelerometer bias",
                                    "gyroscope bias"};
  for (int k = 0; k < rms.size() && k < 5; ++k) {
    facts->Add(prefix + kKinds[k],
               fmt::format("{:.2f} standard deviations rms", rms.Get(k)));
  }
}

int Residuals(Context* context, const SegmentOptions& options) {
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  v1::GetSegmentResidualsRequest request;
  request.set_name(options.name());
  request.set_calibration_version(options.version);
  v1::SegmentResiduals residuals;
  const auto status = Call<SegmentService>(
      stub.get(), &SegmentService::GetSegmentResiduals, request, &residuals);
  if (!status.ok()) return Fail(*context, status);
  if (context->json) {
    context->PrintJson(residuals);
    return kDone;
  }
  Facts facts;
  facts.Add("version", fmt::format("{}", residuals.calibration_version()));
  for (const auto& camera : residuals.cameras()) {
    facts.Add(fmt::format("camera {}", camera.camera()),
              fmt::format("{:.3f} px rms over {} of {}",
                          camera.inlier_rms_px(),
                          camera.inliers(),
                          CountText(camera.observations(), "observation")));
  }
  facts.Add("median",
            fmt::format("{:.3f} px", residuals.reprojection_median_px()));
  AddInertialRms("", residuals.inertial_rms(), &facts);
  AddInertialRms("second IMU: ", residuals.imu1_inertial_rms(), &facts);
  context->Print(facts);
  return kDone;
}

}  // namespace

void AddSegmentDetails(CLI::App* segments, Context* context) {
  const auto options = std::make_shared<SegmentOptions>();
  const auto add = [&](const std::string& name, const std::string& help) {
    CLI::App* command = segments->add_subcommand(name, help);
    command->add_option("RIG", options->rig)->required();
    command
        ->add_option(
            "SEGMENT", options->segment, "session~index, as in the list")
        ->required();
    return command;
  };
  add("information",
      "Show the standard deviation of each component before and after this "
      "segment alone")
      ->callback([context, options] {
        context->command = [context, options] {
          return Information(context, *options);
        };
      });
  CLI::App* residuals = add("residuals",
                            "Compute the residuals of a segment whose data is "
                            "stored; --json has all of them");
  residuals
      ->add_option("--version",
                   options->version,
                   "Version of the calibration [that of the segment]")
      ->check(AtLeastOne());
  residuals->callback([context, options] {
    context->command = [context, options] {
      return Residuals(context, *options);
    };
  });
}

}  // namespace selfcal::client
