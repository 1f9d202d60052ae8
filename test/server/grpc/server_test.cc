#include "server/grpc/server.h"

#include <grpcpp/impl/codegen/sync_stream.h>

#include "test/server/grpc/methods.h"
#include "test/server/grpc/service_test.h"
#include "test/support/grpc_health.h"

namespace selfcal::server {
namespace {

using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

using ServerTest = ServiceTest;

TEST_F(ServerTest, HealthIsServingForAllAndEachService) {
  for (const std::string service : {"",
                                    "selfcal.v1.RigService",
                                    "selfcal.v1.SegmentService",
                                    "selfcal.v1.CalibrationService",
                                    "selfcal.v1.RecalibrationService"}) {
    EXPECT_EQ(HealthOf(channel_.get(), service), kServing) << service;
  }
  EXPECT_EQ(HealthOf(channel_.get(), "no.such.Service"),
            std::to_string(grpc::StatusCode::NOT_FOUND));
}

TEST_F(ServerTest, ReflectionListsTheServices) {
  Context context;
  const grpc::internal::RpcMethod method(
      "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
      grpc::internal::RpcMethod::BIDI_STREAMING);
  const std::unique_ptr<
      grpc::ClientReaderWriter<grpc::ByteBuffer, grpc::ByteBuffer>>
      stream(grpc::internal::ClientReaderWriterFactory<
             grpc::ByteBuffer,
             grpc::ByteBuffer>::Create(channel_.get(), method, &context));
  constexpr int kListServices = 7;
  ASSERT_TRUE(stream->Write(Buffer(TextField(kListServices, "*"))));
  grpc::ByteBuffer response;
  ASSERT_TRUE(stream->Read(&response));
  stream->WritesDone();
  EXPECT_TRUE(stream->Finish().ok());
  const std::string listed = Bytes(response);
  for (const std::string service : {"selfcal.v1.RigService",
                                    "selfcal.v1.SegmentService",
                                    "selfcal.v1.CalibrationService",
                                    "selfcal.v1.RecalibrationService",
                                    "grpc.health.v1.Health"}) {
    EXPECT_THAT(listed, HasSubstr(service));
  }
  // The tests of access go through these: none is served beside them.
  std::size_t served = 0;
  for (auto at = listed.find("selfcal.v1."); at != listed.npos;
       at = listed.find("selfcal.v1.", at + 1)) {
    ++served;
  }
  EXPECT_EQ(served, Services().size());
}

TEST_F(ServerTest, FreePortIsTakenAndNamed) {
  ServerOptions options;
  options.listen = {"insecure:127.0.0.1:0",
                    "unix:" + (folder_ / "other").string()};
  const auto server = NewServer(options);
  ASSERT_TRUE(server.ok()) << server.status();
  EXPECT_THAT((*server)->addresses(),
              ElementsAre(StartsWith("127.0.0.1:"), options.listen[1]));
  EXPECT_NE((*server)->addresses()[0], "127.0.0.1:0");
  for (const std::string& address : (*server)->addresses()) {
    channel_ = grpc::CreateChannel(address, grpc::InsecureChannelCredentials());
    EXPECT_EQ(HealthOf(channel_.get(), ""), kServing) << address;
  }
}

TEST_F(ServerTest, AddressInUseOrImpossibleIsAnError) {
  ServerOptions options;
  options.listen = {"insecure:127.0.0.1:0"};
  const auto first = NewServer(options);
  ASSERT_TRUE(first.ok()) << first.status();
  for (const std::string& address : {"insecure:" + (*first)->addresses()[0],
                                     std::string("unix:/no/such/folder/socket"),
                                     "unix:/" + std::string(200, 'x')}) {
    options.listen = {address};
    const auto second = NewServer(options);
    EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable);
    EXPECT_THAT(std::string(second.status().message()), HasSubstr(address));
  }
  options.listen.clear();
  EXPECT_EQ(NewServer(options).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_F(ServerTest, ShutdownEndsWatchesWithAWordAboutRetrying) {
  AddRig();
  Context context;
  v1::WatchCalibrationRequest request;
  request.set_parent("rigs/r");
  const auto reader = calibrations_->WatchCalibration(&context, request);
  v1::Calibration seen;
  ASSERT_TRUE(reader->Read(&seen));
  server_->Shutdown(milliseconds(20'000));
  EXPECT_FALSE(reader->Read(&seen));
  const grpc::Status status = reader->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_GT(DetailOf<google::rpc::RetryInfo>(status).retry_delay().seconds(),
            0);
}

TEST_F(ServerTest, ShutdownDoesNotWaitForAnIdleStreamBeyondItsDeadline) {
  const auto segments = TestSegments(AddRig(), 1);
  Context context;
  const auto stream = segments_->StreamSegments(&context);
  v1::StreamSegmentsRequest request;
  request.set_parent("rigs/r");
  *request.mutable_segment() = ToProto(segments[0]);
  ASSERT_TRUE(stream->Write(request));
  v1::StreamSegmentsResponse response;
  ASSERT_TRUE(stream->Read(&response));
  server_->Shutdown(milliseconds(50));
  server_->Shutdown(milliseconds(50));
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_FALSE(stream->Finish().ok());
}

TEST_F(ServerTest, WatchesThatAreOpenedAtOnceAllStand) {
  AddRig();
  ServerOptions options;
  options.max_threads = 2;
  StartServer(options);
  std::vector<std::unique_ptr<Context>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::Calibration>>> readers;
  v1::WatchCalibrationRequest request;
  request.set_parent("rigs/r");
  for (int i = 0; i < 90; ++i) {
    contexts.push_back(std::make_unique<Context>());
    readers.push_back(
        calibrations_->WatchCalibration(contexts.back().get(), request));
  }
  v1::Calibration seen;
  for (int i = 0; i < 90; ++i) {
    EXPECT_TRUE(readers[i]->Read(&seen)) << i;
    contexts[i]->TryCancel();
    readers[i]->Finish();
  }
}

TEST_F(ServerTest, ManyWatchersDoNotKeepOthersOut) {
  AddRig();
  std::vector<std::unique_ptr<Context>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::Calibration>>> readers;
  v1::WatchCalibrationRequest request;
  request.set_parent("rigs/r");
  v1::Calibration seen;
  for (int i = 0; i < 50; ++i) {
    contexts.push_back(std::make_unique<Context>());
    readers.push_back(
        calibrations_->WatchCalibration(contexts.back().get(), request));
    ASSERT_TRUE(readers.back()->Read(&seen));
  }
  EXPECT_EQ(HealthOf(channel_.get(), ""), kServing);
  for (int i = 0; i < 50; ++i) {
    contexts[i]->TryCancel();
    readers[i]->Finish();
  }
}

}  // namespace
}  // namespace selfcal::server
