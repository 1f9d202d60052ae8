// A gRPC server for services that a test implements: on a unix socket of its
// own, which it keeps over restarts, or on a port of this machine. The services
// must outlive it.
#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "test/support/temp_folder.h"

namespace selfcal {

class GrpcServer {
 public:
  explicit GrpcServer(std::vector<grpc::Service*> services)  // not started
      : services_(std::move(services)),
        target_("unix:" + folder_.File("grpc.sock")) {}
  ~GrpcServer() { Stop(); }
  GrpcServer(const GrpcServer&) = delete;
  GrpcServer& operator=(const GrpcServer&) = delete;

  // Address in the syntax of gRPC.
  const std::string& target() const { return target_; }

  void Start() { Listen(target_, grpc::InsecureServerCredentials(), nullptr); }
  // On a free port of the loopback, which target() names from now on.
  void StartOnPort(
      const std::shared_ptr<grpc::ServerCredentials>& credentials) {
    int port = 0;
    Listen("127.0.0.1:0", credentials, &port);
    target_ = "127.0.0.1:" + std::to_string(port);
  }

  // Cancels the calls in progress.
  void Stop() {
    if (server_ == nullptr) return;
    server_->Shutdown(std::chrono::system_clock::now());
    server_->Wait();
    server_.reset();
  }
  // Stops after the calls in progress have ended.
  void FinishAndStop() {
    server_->Shutdown();
    server_.reset();
  }

 private:
  void Listen(const std::string& address,
              const std::shared_ptr<grpc::ServerCredentials>& credentials,
              int* port) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort(address, credentials, port);
    for (grpc::Service* service : services_) builder.RegisterService(service);
    server_ = builder.BuildAndStart();
    if (server_ == nullptr) throw std::runtime_error("cannot serve " + address);
  }

  const std::vector<grpc::Service*> services_;
  const TempFolder folder_;
  std::string target_;
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace selfcal
