#include "server/service/errors.h"

#include <google/protobuf/message.h>

#include <algorithm>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace selfcal::server {
namespace {

constexpr std::size_t kMaxMessageBytes = 1000;
constexpr std::size_t kMaxTextBytes = 300;
// Of the violations; base64 makes 4/3 of it in the trailer.
constexpr std::size_t kMaxViolationBytes = 3500;
constexpr int kRetryDelay_s = 1;

// absl and gRPC number the canonical codes alike.
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

// Bytes of the UTF-8 character that the text begins with; 0 if it begins with
// none, or with a control character.
std::size_t CharacterSize(std::string_view text) {
  const auto byte = [&](std::size_t i) {
    return static_cast<unsigned char>(text[i]);
  };
  const unsigned char first = byte(0);
  if (first < 0x80) return first >= 0x20 && first != 0x7f ? 1 : 0;
  const std::size_t size = first >= 0xc2 && first <= 0xdf   ? 2
                           : first >= 0xe0 && first <= 0xef ? 3
                           : first >= 0xf0 && first <= 0xf4 ? 4
                                                            : 0;
  if (size == 0 || text.size() < size) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
  }
  // Longer than needed, a surrogate, or beyond the last code point.
  if (first == 0xe0 && byte(1) < 0xa0) return 0;
  if (first == 0xed && byte(1) > 0x9f) return 0;
  if (first == 0xf0 && byte(1) < 0x90) return 0;
  if (first == 0xf4 && byte(1) > 0x8f) return 0;
  return size;
}

google::rpc::RetryInfo Retry() {
  google::rpc::RetryInfo retry;
  retry.mutable_retry_delay()->set_seconds(kRetryDelay_s);
  return retry;
}

}  // namespace

std::string Shortened(std::string_view text, std::size_t max_bytes) {
  constexpr std::string_view kEllipsis = "...";
  std::string result;
  std::size_t i = 0;
  // Where the result ends if the rest does not fit.
  std::size_t cut = 0;
  while (i < text.size() && result.size() <= max_bytes) {
    const std::size_t size = CharacterSize(text.substr(i));
    if (size == 0) {
      result += '?';
    } else {
      result += text.substr(i, size);
    }
    i += std::max<std::size_t>(size, 1);
    if (result.size() + kEllipsis.size() <= max_bytes) cut = result.size();
  }
  if (result.size() <= max_bytes) return result;
  return result.substr(0, cut) + std::string(kEllipsis);
}

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
