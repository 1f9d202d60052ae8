#include "client/demo/daemon_view.h"

#include <grpcpp/create_channel.h>

#include <algorithm>
#include <chrono>

#include "client/selfcal/connection.h"
#include "proto/convert.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "selfcal/v1/recalibration.grpc.pb.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {

struct DaemonView::Stubs {
  explicit Stubs(const std::shared_ptr<grpc::Channel>& channel)
      : rigs(channel),
        segments(channel),
        calibrations(channel),
        runs(channel) {}
  v1::RigService::Stub rigs;
  v1::SegmentService::Stub segments;
  v1::CalibrationService::Stub calibrations;
  v1::RecalibrationService::Stub runs;
};

namespace {

// Collects all pages of a list.
template <typename Request, typename Response, typename Item, typename Call>
absl::StatusOr<std::vector<Item>> ListAll(
    const std::string& parent,
    const google::protobuf::RepeatedPtrField<Item>& (Response::*items)() const,
    const Call& call) {
  std::vector<Item> all;
  Request request;
  request.set_parent(parent);
  request.set_page_size(1000);
  do {
    grpc::ClientContext context;
    Response response;
    const grpc::Status status = call(&context, request, &response);
    if (!status.ok()) return ToAbsl(status);
    all.insert(
        all.end(), (response.*items)().begin(), (response.*items)().end());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return all;
}

}  // namespace

DaemonView::DaemonView(const std::string& target, const std::string& rig)
    : stubs_(std::make_unique<Stubs>(MakeChannel(target))),
      parent_(RigName(rig)) {}

DaemonView::~DaemonView() = default;

absl::Status DaemonView::CreateRig(const Rig& rig) {
  v1::CreateRigRequest request;
  *request.mutable_rig() = ToProto(rig);
  grpc::ClientContext context;
  v1::Rig response;
  return ToAbsl(stubs_->rigs.CreateRig(&context, request, &response));
}

absl::StatusOr<v1::Calibration> DaemonView::GetActive() {
  v1::GetCalibrationRequest request;
  request.set_name(parent_ + "/calibrations/active");
  grpc::ClientContext context;
  v1::Calibration response;
  const grpc::Status status =
      stubs_->calibrations.GetCalibration(&context, request, &response);
  if (!status.ok()) return ToAbsl(status);
  return response;
}

absl::StatusOr<bool> DaemonView::HasUnscored() {
  v1::ListSegmentsRequest request;
  request.set_parent(parent_);
  request.set_page_size(1);
  request.set_filter("state = STORED");
  request.set_view(v1::ListSegmentsRequest::BASIC);
  grpc::ClientContext context;
  v1::ListSegmentsResponse response;
  const grpc::Status status =
      stubs_->segments.ListSegments(&context, request, &response);
  if (!status.ok()) return ToAbsl(status);
  return response.segments_size() > 0;
}

absl::StatusOr<std::vector<v1::Table>> DaemonView::GetTables() {
  v1::ListTablesRequest request;
  request.set_parent(parent_);
  grpc::ClientContext context;
  v1::ListTablesResponse response;
  const grpc::Status status =
      stubs_->segments.ListTables(&context, request, &response);
  if (!status.ok()) return ToAbsl(status);
  return std::vector<v1::Table>(response.tables().begin(),
                                response.tables().end());
}

absl::StatusOr<std::vector<v1::Recalibration>> DaemonView::GetRuns() {
  return ListAll<v1::ListRecalibrationsRequest>(
      parent_,
      &v1::ListRecalibrationsResponse::recalibrations,
      [&](auto* context, const auto& request, auto* response) {
        return stubs_->runs.ListRecalibrations(context, request, response);
      });
}

absl::StatusOr<DaemonState> DaemonView::GetState() {
  auto segments = ListAll<v1::ListSegmentsRequest>(
      parent_,
      &v1::ListSegmentsResponse::segments,
      [&](auto* context, const auto& request, auto* response) {
        return stubs_->segments.ListSegments(context, request, response);
      });
  if (!segments.ok()) return segments.status();
  auto tables = GetTables();
  if (!tables.ok()) return tables.status();
  auto calibrations = ListAll<v1::ListCalibrationsRequest>(
      parent_,
      &v1::ListCalibrationsResponse::calibrations,
      [&](auto* context, const auto& request, auto* response) {
        return stubs_->calibrations.ListCalibrations(
            context, request, response);
      });
  if (!calibrations.ok()) return calibrations.status();
  DaemonState state{
      *std::move(segments), *std::move(tables), *std::move(calibrations)};
  std::reverse(state.segments.begin(), state.segments.end());
  std::reverse(state.calibrations.begin(), state.calibrations.end());
  return state;
}

absl::StatusOr<v1::Recalibration> DaemonView::StartRun() {
  v1::StartRecalibrationRequest request;
  request.set_parent(parent_);
  grpc::ClientContext context;
  v1::Recalibration response;
  const grpc::Status status =
      stubs_->runs.StartRecalibration(&context, request, &response);
  if (!status.ok()) return ToAbsl(status);
  return response;
}

absl::Status DaemonView::WatchRun(
    const std::string& name,
    const std::function<void(const v1::Recalibration&)>& callback) {
  v1::WatchRecalibrationRequest request;
  request.set_name(name);
  grpc::ClientContext context;
  auto reader = stubs_->runs.WatchRecalibration(&context, request);
  v1::Recalibration update;
  while (reader->Read(&update)) callback(update);
  return ToAbsl(reader->Finish());
}

}  // namespace selfcal::client
