#include "server/api/errors.h"

#include <google/protobuf/any.pb.h>
#include <google/protobuf/message.h>

#include <algorithm>

#include "google/rpc/error_details.pb.h"
#include "proto/safe_text.h"

namespace selfcal::server {
namespace {

constexpr std::size_t kMaxMessageBytes = 1000;
constexpr std::size_t kMaxTextBytes = 300;
// Of the violations; base64 makes 4/3 of it in the trailer.
constexpr std::size_t kMaxViolationBytes = 3500;
constexpr int kRetryDelay_s = 1;

std::string Text(absl::string_view text) { return {text.data(), text.size()}; }

absl::Status WithDetail(absl::Status status,
                        const google::protobuf::Message& detail) {
  google::protobuf::Any any;
  any.PackFrom(detail);
  status.SetPayload(any.type_url(), absl::Cord(any.value()));
  return status;
}

}  // namespace

absl::Status About(const absl::Status& status, const Subject& subject) {
  switch (status.code()) {
    case absl::StatusCode::kInvalidArgument:
      if (subject.field.empty()) return status;
      return InvalidFields({{subject.field, Text(status.message())}});
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kAlreadyExists: {
      google::rpc::ResourceInfo resource;
      resource.set_resource_type(subject.type);
      resource.set_resource_name(SafeLine(subject.name, kMaxTextBytes));
      return WithDetail(status, resource);
    }
    default:
      return status;
  }
}

absl::Status InvalidFields(const std::vector<Violation>& violations) {
  google::rpc::BadRequest request;
  std::size_t bytes = 0;
  for (const Violation& violation : violations) {
    const std::string field = SafeLine(violation.field, kMaxTextBytes);
    const std::string text = SafeLine(violation.message, kMaxTextBytes);
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
  return WithDetail(absl::InvalidArgumentError(message), request);
}

absl::Status BadName(std::string_view field, std::string_view pattern) {
  return InvalidFields({{std::string(field),
                         "is not a name of the form " + std::string(pattern)}});
}

absl::Status ShuttingDown() {
  return ForClient(absl::UnavailableError(
      "the daemon is stopping; connect again in a moment"));
}

absl::Status ForClient(const absl::Status& status) {
  if (status.ok()) return status;
  absl::Status bounded(status.code(),
                       SafeLine(Text(status.message()), kMaxMessageBytes));
  status.ForEachPayload([&](absl::string_view type, const absl::Cord& detail) {
    bounded.SetPayload(type, detail);
  });
  if (!absl::IsUnavailable(status) && !absl::IsResourceExhausted(status)) {
    return bounded;
  }
  google::rpc::RetryInfo retry;
  retry.mutable_retry_delay()->set_seconds(kRetryDelay_s);
  return WithDetail(std::move(bounded), retry);
}

google::rpc::Status ToMessage(const absl::Status& status) {
  google::rpc::Status message;
  message.set_code(static_cast<int>(status.code()));
  message.set_message(Text(status.message()));
  status.ForEachPayload([&](absl::string_view type, const absl::Cord& detail) {
    google::protobuf::Any* any = message.add_details();
    any->set_type_url(Text(type));
    any->set_value(std::string(detail));
  });
  return message;
}

}  // namespace selfcal::server
