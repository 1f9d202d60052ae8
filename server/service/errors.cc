#include "server/service/errors.h"

#include <google/protobuf/message.h>

#include <algorithm>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "server/encode/shortened.h"

namespace selfcal::server {
namespace {

constexpr std::size_t kMaxMessageBytes = 1000;
constexpr std::size_t kMaxTextBytes = 300;
// Limit on the size of the violations; base64 enlarges it by 4/3 in the
// trailer.
constexpr std::size_t kMaxViolationBytes = 3500;
constexpr int kRetryDelay_s = 1;

// absl and gRPC use the same numbers for the canonical codes.
grpc::StatusCode Code(absl::StatusCode code) {
  return static_cast<grpc::StatusCode>(static_cast<int>(code));
}

grpc::Status Build(grpc::StatusCode code,
                   std::string_view message,
                   const google::protobuf::Message* detail) {
  google::rpc::Status status;
  status.set_code(code);
  status.set_message(Shortened(message, kMaxMessageBytes));
  if (detail == nullptr) return {code, status.message()};
  status.add_details()->PackFrom(*detail);
  return {code, status.message(), status.SerializeAsString()};
}

google::rpc::RetryInfo Retry() {
  google::rpc::RetryInfo retry;
  retry.mutable_retry_delay()->set_seconds(kRetryDelay_s);
  return retry;
}

}  // namespace

grpc::Status ToGrpc(const absl::Status& status, const Subject& subject) {
  if (status.ok()) return grpc::Status::OK;
  const std::string message(status.message().data(), status.message().size());
  const grpc::StatusCode code = Code(status.code());
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
      if (subject.field.empty()) break;
      return InvalidFields({{subject.field, message}});
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kAlreadyExists: {
      google::rpc::ResourceInfo resource;
      resource.set_resource_type(subject.type);
      resource.set_resource_name(Shortened(subject.name, kMaxTextBytes));
      return Build(code, message, &resource);
    }
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kResourceExhausted: {
      const google::rpc::RetryInfo retry = Retry();
      return Build(code, message, &retry);
    }
    default:
      break;
  }
  return Build(code, message, nullptr);
}

grpc::Status InvalidFields(const std::vector<Violation>& violations) {
  google::rpc::BadRequest request;
  std::size_t bytes = 0;
  for (const Violation& violation : violations) {
    const std::string field = Shortened(violation.field, kMaxTextBytes);
    const std::string text = Shortened(violation.message, kMaxTextBytes);
    bytes += field.size() + text.size();
    auto* added = request.add_field_violations();
    if (bytes > kMaxViolationBytes) {
      const int left = static_cast<int>(violations.size()) -
                       request.field_violations_size() + 1;
      added->set_description("and " + std::to_string(left) +
                             " more; correct these first");
      break;
    }
    added->set_field(field);
    added->set_description(text);
  }
  std::string message;
  for (const auto& violation : request.field_violations()) {
    if (!message.empty()) message += "; ";
    if (!violation.field().empty()) message += violation.field() + ": ";
    message += violation.description();
  }
  return Build(grpc::StatusCode::INVALID_ARGUMENT, message, &request);
}

grpc::Status BadName(std::string_view field, std::string_view pattern) {
  return InvalidFields({{std::string(field),
                         "is not a name of the form " + std::string(pattern)}});
}

grpc::Status ShuttingDown() {
  return ToGrpc(absl::UnavailableError(
                    "the daemon is stopping; connect again in a moment"),
                {});
}

}  // namespace selfcal::server
