#include "server/service/segment_stream.h"

#include <utility>
#include <vector>

#include "proto/convert.h"
#include "proto/field_paths.h"
#include "proto/resource_names.h"
#include "server/encode/shortened.h"
#include "server/service/errors.h"
#include "server/service/traffic.h"

namespace selfcal::server {
namespace {

// Longer names of sessions are refused, so that responses may truncate them.
constexpr std::size_t kMaxSessionEcho = 256;
constexpr std::size_t kMaxDescription = 1000;

void Reject(const std::vector<Violation>& violations,
            v1::StreamSegmentsResponse* response) {
  response->set_verdict(v1::StreamSegmentsResponse::REJECTED);
  for (const Violation& violation : violations) {
    v1::FieldViolation* added = response->add_violations();
    added->set_field(SegmentFieldPath(violation.field));
    added->set_description(Shortened(violation.message, kMaxDescription));
  }
}

void FillVerdict(const SubmitResult& result,
                 v1::StreamSegmentsResponse* response) {
  switch (result.verdict) {
    case SubmitResult::Verdict::kStored:
      response->set_verdict(v1::StreamSegmentsResponse::STORED);
      return;
    case SubmitResult::Verdict::kDuplicate:
      response->set_verdict(v1::StreamSegmentsResponse::DUPLICATE);
      return;
    case SubmitResult::Verdict::kRejected:
      Reject(result.violations, response);
      return;
  }
}

}  // namespace

SegmentStream::SegmentStream(const ServiceContext& context,
                             std::function<bool()> cancelled)
    : context_(context), cancelled_(std::move(cancelled)) {}

SegmentStream::~SegmentStream() {
  if (parent_.empty()) return;
  context_.traffic->Closed(rig_);
  if (stored_ && !stopped()) context_.pipeline->EndSession(rig_);
}

bool SegmentStream::stopped() const { return context_.stopping->load(); }

void SegmentStream::Answered(v1::StreamSegmentsResponse response,
                             const Done& done) {
  if (response.verdict() == v1::StreamSegmentsResponse::STORED) {
    stored_ = true;
    context_.traffic->Stored(rig_);
  } else if (response.verdict() == v1::StreamSegmentsResponse::REJECTED) {
    context_.traffic->Rejected(rig_);
  }
  done({grpc::Status::OK, std::move(response)});
}

grpc::Status SegmentStream::Open(const std::string& parent) {
  const auto rig = ParseRigName(parent);
  if (!rig) return BadName("parent", "rigs/{rig}");
  const absl::Status found = context_.store->GetRig(*rig).status();
  if (!found.ok()) {
    return ToGrpc(found, {"selfcal.v1.Rig", parent, "parent"});
  }
  parent_ = parent;
  rig_ = *rig;
  context_.traffic->Opened(rig_);
  return grpc::Status::OK;
}

void SegmentStream::Take(const v1::StreamSegmentsRequest& request,
                         const Done& done) {
  if (stopped()) return done({ShuttingDown(), {}});
  if (parent_.empty()) {
    grpc::Status open = Open(request.parent());
    if (!open.ok()) return done({std::move(open), {}});
  }
  v1::StreamSegmentsResponse response;
  response.set_session(Shortened(request.segment().session(), kMaxSessionEcho));
  response.set_index(request.segment().index());
  if (!request.parent().empty() && request.parent() != parent_) {
    Reject({{"parent",
             "is not the rig of the first message; open a stream for each "
             "rig"}},
           &response);
    return Answered(std::move(response), done);
  }
  MotionSegment segment;
  const auto violations = FromProto(request.segment(), "", &segment);
  if (!violations.empty()) {
    Reject(violations, &response);
    return Answered(std::move(response), done);
  }
  context_.pipeline->BeginSubmit(
      rig_,
      segment,
      [this] { return stopped() || cancelled_(); },
      [this, done, response](const auto& result) {
        Answer answer{grpc::Status::OK, response};
        if (result.ok()) {
          FillVerdict(*result, &answer.response);
          return Answered(std::move(answer.response), done);
        }
        if (stopped()) {
          answer.status = ShuttingDown();
        } else {
          answer.status =
              ToGrpc(result.status(), {"selfcal.v1.Rig", parent_, "segment"});
        }
        done(std::move(answer));
      });
}

}  // namespace selfcal::server
