#include "client/cli/device_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "proto/convert.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "selfcal/v1/segment.grpc.pb.h"

namespace selfcal::client {
namespace {

using SegmentStub = v1::SegmentService::StubInterface;

// Lists one page of segments, newest first.
grpc::Status ListNewest(SegmentStub* stub,
                        const std::string& rig,
                        const std::string& filter,
                        int count,
                        v1::ListSegmentsResponse* listed) {
  v1::ListSegmentsRequest request;
  request.set_parent(RigName(rig));
  request.set_filter(filter);
  request.set_order_by("receive_time desc");
  request.set_page_size(count);
  return Call<SegmentStub>(stub, &SegmentStub::ListSegments, request, listed);
}

// Adds the segment, unless its data was dropped since it was listed.
grpc::Status AddSegment(SegmentStub* stub,
                        const std::string& name,
                        std::vector<MotionSegment>* segments) {
  v1::GetSegmentDataRequest request;
  request.set_name(name);
  v1::MotionSegment message;
  const grpc::Status status =
      Call<SegmentStub>(stub, &SegmentStub::GetSegmentData, request, &message);
  if (status.error_code() == grpc::StatusCode::FAILED_PRECONDITION) {
    return grpc::Status::OK;
  }
  if (!status.ok()) return status;
  MotionSegment segment;
  const auto violations = FromProto(message, "", &segment);
  if (!violations.empty()) {
    return {
        grpc::StatusCode::DATA_LOSS,
        fmt::format(
            "{}: {}: {}", name, violations[0].field, violations[0].message)};
  }
  segments->push_back(std::move(segment));
  return grpc::Status::OK;
}

}  // namespace

grpc::Status ReadDevice(Context* context,
                        const std::string& rig,
                        v1::Rig* found) {
  using Service = v1::RigService::StubInterface;
  const auto stub = v1::RigService::NewStub(context->Channel());
  v1::GetRigRequest request;
  request.set_name(RigName(rig));
  return Call<Service>(stub.get(), &Service::GetRig, request, found);
}

grpc::Status ReadDeviceVersion(Context* context,
                               const std::string& rig,
                               const std::string& version,
                               DeviceVersion* found,
                               std::optional<double> temperature_c) {
  grpc::Status status = ReadDevice(context, rig, &found->rig_message);
  if (!status.ok()) return status;
  using Service = v1::CalibrationService::StubInterface;
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  v1::GetCalibrationRequest request;
  request.set_name(ChildName(rig, "calibrations", version));
  if (temperature_c) request.set_temperature_c(*temperature_c);
  status = Call<Service>(
      stub.get(), &Service::GetCalibration, request, &found->message);
  if (!status.ok()) return status;
  auto faults = FromProto(found->rig_message, "rig", &found->rig);
  if (faults.empty()) {
    faults =
        FromProto(found->message.parameters(), "parameters", &found->theta);
  }
  if (faults.empty()) return status;
  return {grpc::StatusCode::DATA_LOSS,
          fmt::format("the daemon's answer cannot be read: {} {}",
                      faults[0].field,
                      faults[0].message)};
}

grpc::Status ReadNewestSegment(Context* context,
                               const std::string& rig,
                               const std::string& filter,
                               v1::Segment* segment) {
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  v1::ListSegmentsResponse listed;
  const grpc::Status status = ListNewest(stub.get(), rig, filter, 1, &listed);
  if (status.ok() && !listed.segments().empty()) *segment = listed.segments(0);
  return status;
}

std::optional<Calibration> ReadVersion(Context* context,
                                       const Rig& rig,
                                       std::int64_t version) {
  if (version <= 1) return rig.factory;
  using Service = v1::CalibrationService::StubInterface;
  const auto stub = v1::CalibrationService::NewStub(context->Channel());
  v1::GetCalibrationRequest request;
  request.set_name(ChildName(rig.id, "calibrations", std::to_string(version)));
  v1::Calibration found;
  Calibration theta;
  const grpc::Status status =
      Call<Service>(stub.get(), &Service::GetCalibration, request, &found);
  if (!status.ok() || !FromProto(found.parameters(), "", &theta).empty()) {
    return std::nullopt;
  }
  return theta;
}

grpc::Status ReadNewestSegments(Context* context,
                                const std::string& rig,
                                int count,
                                std::vector<MotionSegment>* segments) {
  const auto stub = v1::SegmentService::NewStub(context->Channel());
  v1::ListSegmentsResponse listed;
  grpc::Status status =
      ListNewest(stub.get(), rig, "has_data = true", 1, &listed);
  if (!status.ok()) return status;
  if (listed.segments().empty()) return grpc::Status::OK;
  const std::string same_version =
      fmt::format("has_data = true AND calibration_version = {}",
                  listed.segments(0).calibration_version());
  listed.Clear();
  status = ListNewest(stub.get(), rig, same_version, count, &listed);
  for (const v1::Segment& segment : listed.segments()) {
    if (status.ok()) status = AddSegment(stub.get(), segment.name(), segments);
  }
  std::reverse(segments->begin(), segments->end());
  return status;
}

}  // namespace selfcal::client
