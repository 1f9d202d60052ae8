#include "server/api/segment_stream.h"

#include <atomic>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "proto/convert.h"
#include "proto/field_paths.h"
#include "proto/resource_names.h"
#include "proto/safe_text.h"
#include "selfcal/v1/segment.pb.h"
#include "server/api/errors.h"
#include "server/api/traffic.h"

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
    added->set_description(SafeLine(violation.message, kMaxDescription));
  }
}

void FillVerdict(const SubmitResult& result,
                 v1::StreamSegmentsResponse* response) {
  switch (result.verdict) {
    case SubmitResult::Verdict::kStored:
      response->set_verdict(v1::StreamSegmentsResponse::STORED);
      response->set_observations_dropped(
          static_cast<std::int32_t>(result.observations_dropped));
      response->set_readings_dropped(
          static_cast<std::int32_t>(result.readings_dropped));
      return;
    case SubmitResult::Verdict::kDuplicate:
      response->set_verdict(v1::StreamSegmentsResponse::DUPLICATE);
      return;
    case SubmitResult::Verdict::kRejected:
      Reject(result.violations, response);
      return;
  }
}

class SegmentExchange final : public Exchange {
 public:
  SegmentExchange(const ApiContext& context, const Call& call)
      : context_(context), call_(call) {}

  ~SegmentExchange() override {
    if (parent_.empty()) return;
    context_.traffic->Closed(rig_);
    if (stored_ && !stopped()) context_.pipeline->EndSession(rig_);
  }

  void Take(const Message& message, const Done& done) override {
    const auto& request =
        static_cast<const v1::StreamSegmentsRequest&>(message);
    v1::StreamSegmentsResponse response;
    if (stopped()) return done(ShuttingDown(), response);
    if (parent_.empty()) {
      const absl::Status open = Open(request.parent());
      if (!open.ok()) return done(ForClient(open), response);
    }
    response.set_session(
        SafeLine(request.segment().session(), kMaxSessionEcho));
    response.set_index(request.segment().index());
    if (!request.parent().empty() && request.parent() != parent_) {
      Reject({{"parent",
               "is another rig than that of the first message; open a stream "
               "for each rig"}},
             &response);
      return Answer(response, done);
    }
    MotionSegment segment;
    const auto violations = FromProto(request.segment(), "", &segment);
    if (!violations.empty()) {
      Reject(violations, &response);
      return Answer(response, done);
    }
    context_.pipeline->BeginSubmit(
        rig_,
        segment,
        [this] { return stopped() || call_.cancelled(); },
        [this, done, response](const auto& result) mutable {
          if (result.ok()) {
            FillVerdict(*result, &response);
            return Answer(response, done);
          }
          done(stopped() ? ShuttingDown()
                         : ForClient(About(result.status(),
                                           {kRigType, parent_, "segment"})),
               response);
        });
  }

 private:
  bool stopped() const { return context_.stopping->load(); }

  absl::Status Open(const std::string& parent) {
    const auto rig = ParseRigName(parent);
    if (!rig) return BadName("parent", "rigs/{rig}");
    const absl::Status found = context_.store->GetRig(*rig).status();
    if (!found.ok()) {
      return About(found, {kRigType, parent, "parent"});
    }
    parent_ = parent;
    rig_ = *rig;
    context_.traffic->Opened(rig_);
    return absl::OkStatus();
  }

  // Counts the verdict, then reports it.
  void Answer(const v1::StreamSegmentsResponse& response, const Done& done) {
    if (response.verdict() == v1::StreamSegmentsResponse::STORED) {
      stored_ = true;
      context_.traffic->Stored(rig_);
    } else if (response.verdict() == v1::StreamSegmentsResponse::REJECTED) {
      context_.traffic->Rejected(rig_);
    }
    done(absl::OkStatus(), response);
  }

  const ApiContext context_;
  const Call& call_;
  std::string parent_;  // empty before the first message
  std::string rig_;
  std::atomic<bool> stored_ = false;  // a segment was stored
};

}  // namespace

std::unique_ptr<Exchange> MakeSegmentStream(const ApiContext& context,
                                            const Call& call) {
  return std::make_unique<SegmentExchange>(context, call);
}

}  // namespace selfcal::server
