// Requests that were recorded from clients of a release, byte by byte, against
// the service as it is now.
#include <google/protobuf/message.h>
#include <grpcpp/impl/codegen/sync_stream.h>

#include <fstream>
#include <set>
#include <sstream>

#include "test/promise.h"
#include "test/server/grpc/methods.h"
#include "test/server/grpc/service_test.h"

namespace selfcal::server {
namespace {

using google::protobuf::DescriptorPool;
using google::protobuf::Message;
using google::protobuf::MessageFactory;

struct Call {
  std::string method;
  std::string status;
  std::vector<std::string> requests;
};

std::string FromHex(const std::string& hex) {
  std::string bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    bytes.push_back(
        static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

std::vector<Call> Recorded() {
  std::ifstream file(SELFCAL_RECORDED_REQUESTS);
  std::vector<Call> calls;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    Call call;
    words >> call.method >> call.status;
    for (std::string hex; words >> hex;) call.requests.push_back(FromHex(hex));
    calls.push_back(std::move(call));
  }
  return calls;
}

const MethodDescriptor& MethodNamed(const std::string& name) {
  const auto* method = DescriptorPool::generated_pool()->FindMethodByName(name);
  if (method == nullptr) throw std::runtime_error(name + " is gone");
  return *method;
}

// Whether every byte of it means something to this program.
bool IsUnderstood(const google::protobuf::Descriptor& type,
                  const std::string& bytes) {
  const std::unique_ptr<Message> message(
      MessageFactory::generated_factory()->GetPrototype(&type)->New());
  if (!message->ParseFromString(bytes)) return false;
  const std::size_t size = message->ByteSizeLong();
  message->DiscardUnknownFields();
  return message->ByteSizeLong() == size;
}

class OldClientsTest : public ServiceTest {
 protected:
  // Sends the bytes as they are. A call that was cancelled then ends with its
  // first answer.
  grpc::Status Replay(const Call& call, std::vector<std::string>* answers) {
    std::string path = "/" + call.method;
    path[path.rfind('.')] = '/';
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() +
                         std::chrono::seconds(60));
    const grpc::internal::RpcMethod rpc(
        path.c_str(), grpc::internal::RpcMethod::BIDI_STREAMING);
    using Bytes = grpc::ByteBuffer;
    const std::unique_ptr<grpc::ClientReaderWriter<Bytes, Bytes>> stream(
        grpc::internal::ClientReaderWriterFactory<Bytes, Bytes>::Create(
            channel_.get(), rpc, &context));
    for (const std::string& request : call.requests) {
      const grpc::Slice slice(request);
      stream->Write(Bytes(&slice, 1));
    }
    stream->WritesDone();
    for (Bytes answer; stream->Read(&answer);) {
      grpc::Slice slice;
      EXPECT_TRUE(answer.DumpToSingleSlice(&slice).ok());
      answers->emplace_back(slice.begin(), slice.end());
      if (call.status == "CANCELLED") context.TryCancel();
    }
    return stream->Finish();
  }

  // What the pipeline would have done with the segments: they fill the tables,
  // and the run that this starts gives a version. Another segment enters one of
  // the tables since: on unchanged ones nothing is recalibrated.
  void FinishFirstRun() {
    const Rig rig = store_->GetRig("r")->rig;
    for (std::int64_t index : {0, 1}) Score(rig, {"walk", index}, 10);
    FinishRun(rig, 1);
    const MotionSegment segment = TestSegments(rig, 1).front();
    ASSERT_TRUE(domain_->PutSegment(rig.id, segment).ok());
    SegmentInformation information = TestInformation(rig, 20);
    for (std::size_t q = 1; q < information.groups.size(); ++q) {
      information.groups[q].gain = 0;
    }
    ASSERT_TRUE(domain_->CommitScore(rig.id, segment.key, information).ok());
  }
};

grpc::StatusCode Code(const std::string& status) {
  if (status == "CANCELLED") return grpc::StatusCode::CANCELLED;
  if (status == "DATA_LOSS") return grpc::StatusCode::DATA_LOSS;
  EXPECT_EQ(status, "OK");
  return grpc::StatusCode::OK;
}

TEST_F(OldClientsTest, RecordedRequestsAreAnsweredAsTheyWere) {
  Promise promise("requests of old clients are answered");
  for (const Call& call : Recorded()) {
    SCOPED_TRACE(call.method);
    ++promise.trials;
    for (const std::string& request : call.requests) {
      EXPECT_TRUE(
          IsUnderstood(*MethodNamed(call.method).input_type(), request));
    }
    std::vector<std::string> answers;
    const grpc::Status status = Replay(call, &answers);
    const bool kept = status.error_code() == Code(call.status) &&
                      (answers.empty() == (call.status == "DATA_LOSS"));
    EXPECT_TRUE(kept) << status.error_code() << ": " << status.error_message();
    if (!kept) ++promise.lost;
    if (call.method == "selfcal.v1.SegmentService.StreamSegments") {
      ASSERT_EQ(answers.size(), call.requests.size());
      for (const std::string& answer : answers) {
        v1::StreamSegmentsResponse response;
        ASSERT_TRUE(response.ParseFromString(answer));
        EXPECT_EQ(response.verdict(), v1::StreamSegmentsResponse::STORED)
            << response.ShortDebugString();
      }
      FinishFirstRun();
    }
  }
}

TEST_F(OldClientsTest, ARequestOfEachMethodWasRecorded) {
  std::set<std::string> recorded;
  for (const Call& call : Recorded()) recorded.insert(call.method);
  std::set<std::string> released;
  std::ifstream contract(SELFCAL_RELEASED_CONTRACT);
  const std::string method = "method ";
  for (std::string line; std::getline(contract, line);) {
    if (!line.starts_with(method)) continue;
    released.insert(line.substr(method.size(), line.find(':') - method.size()));
  }
  EXPECT_FALSE(released.empty());
  EXPECT_EQ(recorded, released);
}

TEST_F(OldClientsTest, AFieldThatIsGoneWouldBeNoticed) {
  // Field 99 of no request: what a removed field would look like.
  const auto& type = *v1::GetRigRequest::descriptor();
  v1::GetRigRequest request;
  request.set_name("rigs/r");
  EXPECT_TRUE(IsUnderstood(type, request.SerializeAsString()));
  EXPECT_FALSE(
      IsUnderstood(type, request.SerializeAsString() + "\x9a\x06\x01x"));
}

}  // namespace
}  // namespace selfcal::server
