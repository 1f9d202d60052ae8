// A daemon with canned answers, for the tests of the commands.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "selfcal/v1/fleet.grpc.pb.h"
#include "selfcal/v1/recalibration.grpc.pb.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "selfcal/v1/segment.grpc.pb.h"
#include "test/client/cli/canned_page.h"
#include "test/support/grpc_server.h"

namespace selfcal::client {

// INVALID_ARGUMENT with details, as the daemon sends it.
inline grpc::Status BadField(const std::string& field,
                             const std::string& description) {
  google::rpc::BadRequest request;
  auto* violation = request.add_field_violations();
  violation->set_field(field);
  violation->set_description(description);
  google::rpc::Status status;
  status.set_code(3);
  status.add_details()->PackFrom(request);
  return {grpc::StatusCode::INVALID_ARGUMENT,
          "bad request",
          status.SerializeAsString()};
}

// NOT_FOUND with details, as the daemon sends it.
inline grpc::Status Missing(const std::string& name) {
  google::rpc::ResourceInfo resource;
  resource.set_resource_name(name);
  google::rpc::Status status;
  status.set_code(5);
  status.add_details()->PackFrom(resource);
  return {grpc::StatusCode::NOT_FOUND,
          name + " does not exist",
          status.SerializeAsString()};
}

struct CannedDaemon final : v1::RigService::Service,
                            v1::SegmentService::Service,
                            v1::CalibrationService::Service,
                            v1::RecalibrationService::Service,
                            v1::FleetService::Service {
  // What it answers, and what it was asked.
  std::vector<v1::Rig> rigs;
  std::vector<v1::Segment> segments;
  v1::ListTablesResponse tables;
  std::vector<v1::Calibration> calibrations;  // the last is active
  std::vector<v1::Recalibration> run;         // as it goes on
  grpc::Status refusal;                       // of CreateRig
  std::string deleted;                        // a rig of `rigs`, meanwhile
  v1::ListCalibrationsRequest::View last_view = {};
  v1::CompareCalibrationsResponse differences;
  std::vector<v1::AdviseMotionResponse> advice;
  std::vector<v1::VerifyRigResponse> verification;
  int max_advice = -1;    // that was asked for
  bool stopping = false;  // and so cancels
  std::string last_name;
  std::string last_reason;
  std::vector<v1::UpdateRigRequest> updates;
  std::vector<v1::MotionSegment> data;  // of the segments, while it is there
  std::string cancelled;                // the run
  std::string last_filter;
  std::string last_order;
  v1::MotionSegment last_segment;  // that was sent
  v1::QuarantineSegmentsRequest last_quarantine;
  bool last_force = false;         // of a recalibration
  std::int64_t reject_index = -1;  // of the segments that are sent
  bool reject_all = false;
  grpc::Status stream_refusal;         // of every stream of segments
  std::atomic<int> broken_watches{0};  // that many end before the run does

  // On a unix socket, or with credentials on a port.
  explicit CannedDaemon(
      const std::shared_ptr<grpc::ServerCredentials>& credentials = nullptr) {
    if (credentials == nullptr) {
      server.Start();
    } else {
      server.StartOnPort(credentials);
    }
    target = server.target();
  }
  ~CannedDaemon() override { server.Stop(); }

  grpc::Status CreateRig(grpc::ServerContext*,
                         const v1::CreateRigRequest* request,
                         v1::Rig* response) override {
    if (!refusal.ok()) return refusal;
    rigs.push_back(request->rig());
    *response = request->rig();
    return grpc::Status::OK;
  }
  grpc::Status GetRig(grpc::ServerContext*,
                      const v1::GetRigRequest* request,
                      v1::Rig* response) override {
    for (const v1::Rig& rig : rigs) {
      if (rig.name() != request->name()) continue;
      *response = rig;
      return grpc::Status::OK;
    }
    return Missing(request->name());
  }
  grpc::Status UpdateRig(grpc::ServerContext*,
                         const v1::UpdateRigRequest* request,
                         v1::Rig* response) override {
    if (request->rig().name() == deleted) return Missing(deleted);
    updates.push_back(*request);
    *response = request->rig();
    return grpc::Status::OK;
  }
  grpc::Status ListRigs(grpc::ServerContext*,
                        const v1::ListRigsRequest* request,
                        v1::ListRigsResponse* response) override {
    last_filter = request->filter();
    FillCannedPage(*request, rigs, response, [&](const v1::Rig& rig) {
      *response->add_rigs() = rig;
    });
    return grpc::Status::OK;
  }

  grpc::Status StreamSegments(
      grpc::ServerContext*,
      grpc::ServerReaderWriter<v1::StreamSegmentsResponse,
                               v1::StreamSegmentsRequest>* stream) override {
    if (!stream_refusal.ok()) return stream_refusal;
    v1::StreamSegmentsRequest request;
    while (stream->Read(&request)) {
      const v1::MotionSegment& segment = request.segment();
      v1::StreamSegmentsResponse response;
      response.set_session(segment.session());
      response.set_index(segment.index());
      response.set_verdict(v1::StreamSegmentsResponse::STORED);
      if (reject_all || segment.index() == reject_index) {
        response.set_verdict(v1::StreamSegmentsResponse::REJECTED);
        auto* violation = response.add_violations();
        violation->set_field("keyframes[3].q_gi");
        violation->set_description("norm is 0.9");
      }
      last_segment = segment;
      stream->Write(response);
    }
    return grpc::Status::OK;
  }
  grpc::Status ListSegments(grpc::ServerContext*,
                            const v1::ListSegmentsRequest* request,
                            v1::ListSegmentsResponse* response) override {
    last_name = request->parent();
    last_filter = request->filter();
    last_order = request->order_by();
    FillCannedPage(
        *request, segments, response, [&](const v1::Segment& segment) {
          *response->add_segments() = segment;
        });
    return grpc::Status::OK;
  }
  grpc::Status GetSegmentData(grpc::ServerContext*,
                              const v1::GetSegmentDataRequest* request,
                              v1::MotionSegment* response) override {
    for (const v1::MotionSegment& one : data) {
      if (request->name() == "rigs/device/segments/" + one.session() + "~" +
                                 std::to_string(one.index())) {
        *response = one;
        return grpc::Status::OK;
      }
    }
    return {grpc::StatusCode::FAILED_PRECONDITION, "its data was dropped"};
  }
  grpc::Status DownloadSegments(
      grpc::ServerContext*,
      const v1::DownloadSegmentsRequest* request,
      grpc::ServerWriter<v1::DownloadSegmentsResponse>* writer) override {
    last_name = request->parent();
    last_filter = request->filter();
    for (const v1::MotionSegment& one : data) {
      v1::DownloadSegmentsResponse response;
      response.set_name("rigs/device/segments/" + one.session() + "~" +
                        std::to_string(one.index()));
      *response.mutable_segment() = one;
      writer->Write(response);
    }
    return grpc::Status::OK;
  }
  grpc::Status GetSegment(grpc::ServerContext*,
                          const v1::GetSegmentRequest* request,
                          v1::Segment* response) override {
    last_name = request->name();
    if (segments.empty()) return {grpc::StatusCode::NOT_FOUND, "no segment"};
    *response = segments.front();
    return grpc::Status::OK;
  }
  grpc::Status ListTables(grpc::ServerContext*,
                          const v1::ListTablesRequest*,
                          v1::ListTablesResponse* response) override {
    *response = tables;
    return grpc::Status::OK;
  }

  grpc::Status GetCalibration(grpc::ServerContext*,
                              const v1::GetCalibrationRequest* request,
                              v1::Calibration* response) override {
    last_name = request->name();
    if (calibrations.empty()) return {grpc::StatusCode::NOT_FOUND, "none"};
    *response = calibrations.back();
    return grpc::Status::OK;
  }
  grpc::Status ListCalibrations(
      grpc::ServerContext*,
      const v1::ListCalibrationsRequest* request,
      v1::ListCalibrationsResponse* response) override {
    last_view = request->view();
    last_filter = request->filter();
    last_order = request->order_by();
    if (!deleted.empty() && request->parent() == deleted) {
      return Missing(deleted);
    }
    FillCannedPage(
        *request, calibrations, response, [&](const v1::Calibration& one) {
          *response->add_calibrations() = one;
        });
    return grpc::Status::OK;
  }
  grpc::Status ActivateCalibration(
      grpc::ServerContext*,
      const v1::ActivateCalibrationRequest* request,
      v1::Calibration* response) override {
    last_name = request->name();
    last_reason = request->reason();
    if (calibrations.empty()) return {grpc::StatusCode::NOT_FOUND, "none"};
    *response = calibrations.back();
    return grpc::Status::OK;
  }
  grpc::Status DescribeCohort(grpc::ServerContext*,
                              const v1::DescribeCohortRequest* request,
                              v1::Cohort* response) override {
    cohort_request = *request;
    *response = cohort;
    return grpc::Status::OK;
  }
  grpc::Status ListCohorts(grpc::ServerContext*,
                           const v1::ListCohortsRequest* request,
                           v1::ListCohortsResponse* response) override {
    for (const v1::CohortVersion& version : cohorts.cohorts()) {
      const bool chosen = request->label() == version.label() &&
                          request->value() == version.value();
      if (request->label().empty() || chosen) {
        *response->add_cohorts() = version;
      }
    }
    return grpc::Status::OK;
  }
  grpc::Status CompareCalibrations(
      grpc::ServerContext*,
      const v1::CompareCalibrationsRequest* request,
      v1::CompareCalibrationsResponse* response) override {
    last_name = request->a() + " " + request->b();
    *response = differences;
    return grpc::Status::OK;
  }
  grpc::Status VerifyRig(
      grpc::ServerContext*,
      const v1::VerifyRigRequest* request,
      grpc::ServerWriter<v1::VerifyRigResponse>* writer) override {
    last_name = request->parent();
    for (const auto& response : verification) writer->Write(response);
    return verification.empty()
               ? grpc::Status(grpc::StatusCode::NOT_FOUND, "no such rig")
               : grpc::Status::OK;
  }
  // The answers in turn; the last stays.
  grpc::Status AdviseMotion(grpc::ServerContext*,
                            const v1::AdviseMotionRequest* request,
                            v1::AdviseMotionResponse* response) override {
    last_name = request->parent();
    max_advice = request->max_advice();
    if (stopping) return grpc::Status::CANCELLED;
    if (advice.empty()) return {grpc::StatusCode::NOT_FOUND, "no such rig"};
    *response = advice.front();
    if (advice.size() > 1) advice.erase(advice.begin());
    return grpc::Status::OK;
  }
  grpc::Status WatchCalibration(
      grpc::ServerContext*,
      const v1::WatchCalibrationRequest*,
      grpc::ServerWriter<v1::Calibration>* writer) override {
    for (const v1::Calibration& calibration : calibrations) {
      writer->Write(calibration);
    }
    return {grpc::StatusCode::UNAVAILABLE, "the daemon is stopping"};
  }

  grpc::Status QuarantineSegments(
      grpc::ServerContext*,
      const v1::QuarantineSegmentsRequest* request,
      v1::QuarantineSegmentsResponse* response) override {
    last_quarantine = *request;
    response->set_quarantined(3);
    return grpc::Status::OK;
  }

  grpc::Status StartRecalibration(grpc::ServerContext*,
                                  const v1::StartRecalibrationRequest* request,
                                  v1::Recalibration* response) override {
    last_force = request->force();
    if (run.empty()) {
      return {grpc::StatusCode::FAILED_PRECONDITION,
              "the tables are empty; send segments first"};
    }
    *response = run.front();
    return grpc::Status::OK;
  }
  grpc::Status WatchRecalibration(
      grpc::ServerContext*,
      const v1::WatchRecalibrationRequest* request,
      grpc::ServerWriter<v1::Recalibration>* writer) override {
    EXPECT_EQ(request->name(), run.front().name());
    writer->Write(run.front());
    if (broken_watches-- > 0) {
      return {grpc::StatusCode::UNAVAILABLE, "the daemon is stopping"};
    }
    for (const v1::Recalibration& update : run) writer->Write(update);
    return grpc::Status::OK;
  }

  grpc::Status ListRecalibrations(
      grpc::ServerContext*,
      const v1::ListRecalibrationsRequest* request,
      v1::ListRecalibrationsResponse* response) override {
    last_name = request->parent();
    last_filter = request->filter();
    last_order = request->order_by();
    FillCannedPage(*request, run, response, [&](const v1::Recalibration& one) {
      *response->add_recalibrations() = one;
    });
    return grpc::Status::OK;
  }
  grpc::Status GetRecalibration(grpc::ServerContext*,
                                const v1::GetRecalibrationRequest* request,
                                v1::Recalibration* response) override {
    last_name = request->name();
    if (run.empty()) return {grpc::StatusCode::NOT_FOUND, "no such run"};
    *response = run.front();
    return grpc::Status::OK;
  }
  grpc::Status CancelRecalibration(
      grpc::ServerContext*,
      const v1::CancelRecalibrationRequest* request,
      v1::Recalibration* response) override {
    cancelled = request->name();
    if (run.empty()) return {grpc::StatusCode::NOT_FOUND, "no such run"};
    *response = run.front();
    response->set_state(v1::Recalibration::CANCELLED);
    return grpc::Status::OK;
  }

  std::string target;
  v1::Cohort cohort;
  v1::ListCohortsResponse cohorts;  // newest first
  v1::DescribeCohortRequest cohort_request;
  GrpcServer server{{static_cast<v1::RigService::Service*>(this),
                     static_cast<v1::SegmentService::Service*>(this),
                     static_cast<v1::CalibrationService::Service*>(this),
                     static_cast<v1::RecalibrationService::Service*>(this),
                     static_cast<v1::FleetService::Service*>(this)}};
};

}  // namespace selfcal::client
