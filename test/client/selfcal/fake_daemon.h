// A daemon for the tests of the client: the generated services over a unix
// socket, with a memory that outlives restarts, and mishaps on demand.
#pragma once

#include <grpcpp/grpcpp.h>

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/model/segment.h"
#include "selfcal/v1/calibration_service.grpc.pb.h"
#include "selfcal/v1/segment.grpc.pb.h"
#include "test/support/grpc_server.h"

namespace selfcal::client {

class FakeDaemon final : private v1::SegmentService::Service,
                         private v1::CalibrationService::Service {
 public:
  // What happens to the n-th request of a connection (from 0), apart from its
  // being stored.
  enum class Mishap {
    kNone,
    kDropAcknowledgement,  // stored, but the connection breaks before the ack
    kDropRequest,          // the connection breaks before it is stored
    kForeignAcknowledgement,
    kUnknownVerdict,
  };

  FakeDaemon() = default;  // not started
  ~FakeDaemon() override;

  std::string target() const { return server_.target(); }
  void Start() { server_.Start(); }
  // On a free port, which target() names from now on.
  void StartOnPort(
      const std::shared_ptr<grpc::ServerCredentials>& credentials) {
    server_.StartOnPort(credentials);
  }
  void Stop() { server_.Stop(); }  // streams that are open are cancelled

  // Settings; may be changed at any time.
  void SetMishaps(std::function<Mishap(const SegmentKey&)> mishaps);
  void Reject(const SegmentKey& key);
  void FailStreamsWith(const grpc::Status& status);  // OK: no more
  // Requests are taken, but not answered, until it is off again.
  void Hold(bool on);
  void Publish(const v1::Calibration& calibration);

  // Waits until so many requests have come on all connections together.
  bool WaitForRequests(std::size_t count);
  // Waits until a watcher has been sent the calibration.
  bool WaitForWatcher(std::int64_t version);

  // Keys in the order of their requests, a list for each connection.
  std::vector<std::vector<SegmentKey>> connections() const;
  std::size_t requests() const;
  std::set<SegmentKey> stored() const;
  int max_unanswered() const;  // requests that waited for their answer at once

 private:
  using SegmentStreamEnd = grpc::ServerReaderWriter<v1::StreamSegmentsResponse,
                                                    v1::StreamSegmentsRequest>;
  grpc::Status StreamSegments(grpc::ServerContext* context,
                              SegmentStreamEnd* stream) override;
  grpc::Status WatchCalibration(
      grpc::ServerContext* context,
      const v1::WatchCalibrationRequest* request,
      grpc::ServerWriter<v1::Calibration>* writer) override;

  // Takes requests until the connection ends.
  struct Inbox;
  void Read(SegmentStreamEnd* stream, Inbox* inbox);
  // The verdict, or nothing if the connection is to break.
  std::optional<v1::StreamSegmentsResponse> Answer(const SegmentKey& key);

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  std::function<Mishap(const SegmentKey&)> mishaps_;
  std::set<SegmentKey> rejected_;
  std::set<SegmentKey> stored_;
  std::vector<std::vector<SegmentKey>> connections_;
  std::size_t requests_ = 0;
  int max_unanswered_ = 0;
  grpc::Status stream_status_;
  bool hold_ = false;
  std::optional<v1::Calibration> active_;
  std::set<std::int64_t> watched_;

  GrpcServer server_{{static_cast<v1::SegmentService::Service*>(this),
                      static_cast<v1::CalibrationService::Service*>(this)}};
};

}  // namespace selfcal::client
