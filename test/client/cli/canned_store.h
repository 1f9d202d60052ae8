// The daemon's StoreService with canned answers, for the tests of the commands.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <string>
#include <thread>
#include <vector>

#include "client/cli/sha256.h"
#include "selfcal/v1/store_service.grpc.pb.h"
#include "test/client/cli/canned_page.h"
#include "test/support/grpc_server.h"

namespace selfcal::client {

struct CannedStore final : v1::StoreService::Service {
  // What it answers, and what it was asked.
  int problems = 0;
  grpc::Status check_status;  // not OK: instead of the summary
  std::string backup_checksum = Checksum("one two");
  grpc::Status backup_status;  // not OK: instead of the summary
  grpc::Status restore_status;
  bool restarts = true;  // after a restore
  std::atomic<int> starts{0};
  std::string restored;
  std::vector<v1::Event> events;
  std::string parent;
  std::string target;

  CannedStore() {
    target = server_.target();
    Start();
  }
  ~CannedStore() override {
    if (restart_.joinable()) restart_.join();
    server_.Stop();
  }

  static std::string Checksum(const std::string& bytes) {
    Sha256 digest;
    digest.Add(bytes);
    return digest.Finish();
  }

  // An hour from one to the next, of two kinds by turns.
  void AddEvents(int count) {
    constexpr std::int64_t kMidnight = 1795219200;  // of 2026-11-21
    for (int k = 1; k <= count; ++k) {
      v1::Event& event = events.emplace_back();
      event.set_number(k);
      event.mutable_time()->set_seconds(kMidnight + 3600 * k);
      event.set_rig("rigs/a");
      event.set_kind(k % 2 == 0 ? v1::Event::DATA_EVICTED
                                : v1::Event::RUN_STARTED);
      event.set_detail("the quota");
    }
  }

  grpc::Status CheckStore(
      grpc::ServerContext*,
      const v1::CheckStoreRequest*,
      grpc::ServerWriter<v1::CheckStoreResponse>* writer) override {
    v1::CheckStoreResponse response;
    for (int k = 0; k < problems; ++k) {
      response.mutable_problem()->set_place("payloads, data of row 7");
      response.mutable_problem()->set_description(
          "its checksum does not match");
      writer->Write(response);
    }
    if (!check_status.ok()) return check_status;
    response.mutable_summary()->set_checksums(12);
    response.mutable_summary()->set_problems(problems);
    writer->Write(response);
    return grpc::Status::OK;
  }

  grpc::Status BackupStore(
      grpc::ServerContext*,
      const v1::BackupStoreRequest*,
      grpc::ServerWriter<v1::BackupStoreResponse>* writer) override {
    v1::BackupStoreResponse response;
    for (const std::string piece : {"one ", "two"}) {
      response.set_data(piece);
      writer->Write(response);
    }
    if (!backup_status.ok()) return backup_status;
    response.mutable_summary()->set_bytes(7);
    response.mutable_summary()->set_sha256(backup_checksum);
    writer->Write(response);
    return grpc::Status::OK;
  }

  grpc::Status RestoreStore(grpc::ServerContext*,
                            grpc::ServerReader<v1::RestoreStoreRequest>* reader,
                            v1::RestoreStoreResponse* response) override {
    v1::RestoreStoreRequest request;
    while (reader->Read(&request)) restored += request.data();
    if (!restore_status.ok()) return restore_status;
    EXPECT_EQ(request.sha256(), Checksum(restored));
    response->set_previous_database("/var/before");
    if (restarts) restart_ = std::thread([this] { Restart(); });
    return grpc::Status::OK;
  }

  grpc::Status ListEvents(grpc::ServerContext*,
                          const v1::ListEventsRequest* request,
                          v1::ListEventsResponse* response) override {
    parent = request->parent();
    FillCannedPage(*request, events, response, [&](const v1::Event& event) {
      *response->add_events() = event;
    });
    return grpc::Status::OK;
  }

 private:
  void Start() {
    ++starts;
    server_.Start();
  }
  void Restart() {
    server_.FinishAndStop();
    Start();
  }

  std::thread restart_;
  GrpcServer server_{{this}};
};

}  // namespace selfcal::client
