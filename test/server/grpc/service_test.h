// A real server on a unix socket over a real SQLite store, and clients of it.
#pragma once

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "proto/convert.h"
#include "proto/resource_names.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "selfcal/v1/recalibration.grpc.pb.h"
#include "selfcal/v1/rig.grpc.pb.h"
#include "selfcal/v1/segment.grpc.pb.h"
#include "server/api/api.h"
#include "server/grpc/server.h"
#include "test/server/served_store.h"
#include "test/support/eventually.h"

namespace selfcal::server {

// The first detail of an error of this type; an empty message if it has none.
template <typename Detail>
Detail DetailOf(const grpc::Status& status) {
  google::rpc::Status details;
  EXPECT_TRUE(details.ParseFromString(status.error_details()));
  Detail detail;
  for (const auto& any : details.details()) {
    if (any.UnpackTo(&detail)) return detail;
  }
  ADD_FAILURE() << "no " << detail.GetTypeName()
                << " in the error: " << status.error_message();
  return detail;
}

inline std::vector<std::string> BadFields(const grpc::Status& status) {
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT)
      << status.error_message();
  std::vector<std::string> fields;
  const auto request = DetailOf<google::rpc::BadRequest>(status);
  for (const auto& violation : request.field_violations()) {
    EXPECT_FALSE(violation.description().empty());
    fields.push_back(violation.field());
  }
  return fields;
}

inline void ExpectNotFound(const grpc::Status& status,
                           const std::string& name) {
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND)
      << status.error_message();
  EXPECT_FALSE(status.error_message().empty());
  EXPECT_EQ(DetailOf<google::rpc::ResourceInfo>(status).resource_name(), name);
}

class ServiceTest : public ServedStore {
 protected:
  using Context = grpc::ClientContext;

  ServiceTest() { StartServer(ServerOptions()); }

  // A server with an API of its own.
  absl::StatusOr<std::unique_ptr<Server>> NewServer(
      const ServerOptions& options,
      const std::function<void(const std::string&)>& tls_refused = {}) {
    return MakeServer(&apis_.emplace_back(&*domain_, pipeline_.get(), &feed_),
                      options,
                      tls_refused);
  }

  void StartServer(ServerOptions options) {
    server_.reset();
    options.listen = {"unix:" + (folder_ / "s").string()};
    auto server = NewServer(options);
    if (!server.ok()) throw std::runtime_error(server.status().ToString());
    server_ = std::move(*server);
    // A channel of its own for each server: no backoff from the one before.
    grpc::ChannelArguments arguments;
    arguments.SetInt("test.generation", ++generation_);
    channel_ = grpc::CreateCustomChannel(
        server_->addresses()[0], grpc::InsecureChannelCredentials(), arguments);
    rigs_ = v1::RigService::NewStub(channel_);
    segments_ = v1::SegmentService::NewStub(channel_);
    calibrations_ = v1::CalibrationService::NewStub(channel_);
    recalibrations_ = v1::RecalibrationService::NewStub(channel_);
  }

  // Puts a score with this information gain for every group.
  void Score(const Rig& rig, const SegmentKey& key, double gain) {
    const auto committed =
        domain_->CommitScore(rig.id, key, TestInformation(rig, gain));
    EXPECT_TRUE(committed.ok()) << committed.status();
  }

  // A rig with `count` segments in the store, scored with gains 10, 11, ...
  Rig AddScored(int count) {
    const Rig rig = AddRig();
    double gain = 10;
    for (const MotionSegment& segment : TestSegments(rig, count)) {
      EXPECT_TRUE(domain_->PutSegment(rig.id, segment).ok());
      Score(rig, segment.key, gain++);
    }
    return rig;
  }

  // Ends the unfinished run of the rig with an active calibration.
  StoredCalibration FinishRun(const Rig& rig, std::int64_t run) {
    EXPECT_TRUE(domain_->BeginRun(rig.id, run).ok());
    StoredCalibration calibration =
        TestCalibration(rig, *store_->GetRun(rig.id, run));
    calibration.report = CalibrationResult();
    calibration.report->status = CalibrateStatus::kConverged;
    calibration.report->theta = rig.factory;
    calibration.report->covariance = calibration.covariance;
    calibration.report->iterations = 7;
    const auto finished = domain_->FinishRun(rig.id, run, calibration);
    EXPECT_TRUE(finished.ok()) << finished.status();
    return *finished;
  }

  std::list<Api> apis_;
  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::RigService::Stub> rigs_;
  std::unique_ptr<v1::SegmentService::Stub> segments_;
  std::unique_ptr<v1::CalibrationService::Stub> calibrations_;
  std::unique_ptr<v1::RecalibrationService::Stub> recalibrations_;

 private:
  int generation_ = 0;
};

}  // namespace selfcal::server
