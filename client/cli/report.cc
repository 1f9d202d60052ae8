// report: writes a calibration as one HTML file.
#include "client/report/report.h"

#include <memory>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/new_file.h"
#include "client/cli/report_file.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {
namespace {

grpc::Status GatherCalibrations(Context* context,
                                const ReportOptions& options,
                                ReportData* data) {
  using Service = v1::CalibrationService::StubInterface;
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  v1::GetCalibrationRequest request;
  request.set_name(ChildName(options.rig, "calibrations", options.version));
  grpc::Status status = Call<Service>(
      stub.get(), &Service::GetCalibration, request, &data->calibration);
  if (!status.ok()) return status;
  v1::ListCalibrationsRequest all;
  all.set_parent(RigName(options.rig));
  v1::ListCalibrationsResponse versions;
  status = CallForAllPages<Service>(
      stub.get(), &Service::ListCalibrations, all, &versions);
  data->versions.assign(versions.calibrations().begin(),
                        versions.calibrations().end());
  return status;
}

grpc::Status GatherSegments(Context* context,
                            const ReportOptions& options,
                            ReportData* data) {
  using Service = v1::SegmentService::StubInterface;
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  v1::ListTablesRequest tables_request;
  tables_request.set_parent(RigName(options.rig));
  v1::ListTablesResponse tables;
  grpc::Status status =
      Call<Service>(stub.get(), &Service::ListTables, tables_request, &tables);
  if (!status.ok()) return status;
  data->tables.assign(tables.tables().begin(), tables.tables().end());
  v1::ListSegmentsRequest request;
  request.set_parent(RigName(options.rig));
  request.set_filter("state = SCORED");
  v1::ListSegmentsResponse segments;
  status = CallForAllPages<Service>(
      stub.get(), &Service::ListSegments, request, &segments);
  data->segments.assign(segments.segments().begin(), segments.segments().end());
  return status;
}

}  // namespace

int WriteReportFile(Context* context, const ReportOptions& options) {
  using Service = v1::RigService::StubInterface;
  NewFile file;
  absl::Status written = file.Open(options.output, options.force);
  if (!written.ok()) return FailInput(written);
  const auto stub = v1::RigService::NewStub(context->Channel());
  v1::GetRigRequest request;
  request.set_name(RigName(options.rig));
  ReportData data;
  grpc::Status status =
      Call<Service>(stub.get(), &Service::GetRig, request, &data.rig);
  if (status.ok()) status = GatherCalibrations(context, options, &data);
  if (status.ok()) status = GatherSegments(context, options, &data);
  if (!status.ok()) return Fail(*context, status);
  written = file.Append(WriteReport(data));
  if (written.ok()) written = file.Commit();
  return written.ok() ? kDone : FailInput(written);
}

CLI::App* AddCalibrationReport(CLI::App* parent,
                               const std::string& name,
                               Context* context) {
  CLI::App* report = parent->add_subcommand(
      name, "Write a report on a calibration as one HTML file");
  const auto options = std::make_shared<ReportOptions>();
  report->add_option("RIG", options->rig)->required();
  report->add_option("VERSION", options->version, "A number, or active")
      ->capture_default_str();
  report->add_option("--output", options->output, "The file")->required();
  report->add_flag(
      "--force", options->force, "Overwrite the file if it exists");
  report->callback([context, options] {
    context->command = [context, options] {
      return WriteReportFile(context, *options);
    };
  });
  return report;
}

}  // namespace selfcal::client
