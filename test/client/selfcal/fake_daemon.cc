#include "test/client/selfcal/fake_daemon.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <thread>
#include <utility>

#include "test/support/eventually.h"

namespace selfcal::client {
// Requests of one connection that wait for their answer.
struct FakeDaemon::Inbox {
  std::size_t connection = 0;
  std::deque<SegmentKey> waiting;
  bool ended = false;
};

FakeDaemon::~FakeDaemon() { Stop(); }

void FakeDaemon::SetMishaps(std::function<Mishap(const SegmentKey&)> mishaps) {
  std::lock_guard lock(mutex_);
  mishaps_ = std::move(mishaps);
}

void FakeDaemon::Reject(const SegmentKey& key) {
  std::lock_guard lock(mutex_);
  rejected_.insert(key);
}

void FakeDaemon::FailStreamsWith(const grpc::Status& status) {
  std::lock_guard lock(mutex_);
  stream_status_ = status;
}

void FakeDaemon::Hold(bool on) {
  {
    std::lock_guard lock(mutex_);
    hold_ = on;
  }
  changed_.notify_all();
}

void FakeDaemon::Publish(const v1::Calibration& calibration) {
  {
    std::lock_guard lock(mutex_);
    active_ = calibration;
  }
  changed_.notify_all();
}

bool FakeDaemon::WaitForRequests(std::size_t count) {
  return Eventually([&] { return requests() >= count; });
}

bool FakeDaemon::WaitForWatcher(std::int64_t version) {
  return Eventually([&] {
    std::lock_guard lock(mutex_);
    return watched_.count(version) > 0;
  });
}

std::vector<std::vector<SegmentKey>> FakeDaemon::connections() const {
  std::lock_guard lock(mutex_);
  return connections_;
}

std::size_t FakeDaemon::requests() const {
  std::lock_guard lock(mutex_);
  return requests_;
}

std::set<SegmentKey> FakeDaemon::stored() const {
  std::lock_guard lock(mutex_);
  return stored_;
}

int FakeDaemon::max_unanswered() const {
  std::lock_guard lock(mutex_);
  return max_unanswered_;
}

grpc::Status FakeDaemon::StreamSegments(grpc::ServerContext* context,
                                        SegmentStreamEnd* stream) {
  Inbox inbox;
  {
    std::lock_guard lock(mutex_);
    if (!stream_status_.ok()) return stream_status_;
    inbox.connection = connections_.size();
    connections_.emplace_back();
  }
  std::thread reader([&] { Read(stream, &inbox); });
  while (true) {
    SegmentKey key;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] {
        return inbox.ended || (!hold_ && !inbox.waiting.empty());
      });
      if (inbox.ended) break;
      key = inbox.waiting.front();
      inbox.waiting.pop_front();
    }
    const auto response = Answer(key);
    if (!response.has_value() || !stream->Write(*response)) break;
  }
  context->TryCancel();
  reader.join();
  return {grpc::StatusCode::UNAVAILABLE, "a mishap"};
}

void FakeDaemon::Read(SegmentStreamEnd* stream, Inbox* inbox) {
  v1::StreamSegmentsRequest request;
  while (stream->Read(&request)) {
    EXPECT_EQ(request.parent(), "rigs/device");
    const SegmentKey key{request.segment().session(),
                         request.segment().index()};
    {
      std::lock_guard lock(mutex_);
      ++requests_;
      connections_[inbox->connection].push_back(key);
      inbox->waiting.push_back(key);
      max_unanswered_ =
          std::max(max_unanswered_, static_cast<int>(inbox->waiting.size()));
    }
    changed_.notify_all();
  }
  {
    std::lock_guard lock(mutex_);
    inbox->ended = true;
  }
  changed_.notify_all();
}

std::optional<v1::StreamSegmentsResponse> FakeDaemon::Answer(
    const SegmentKey& key) {
  std::lock_guard lock(mutex_);
  const Mishap mishap = mishaps_ ? mishaps_(key) : Mishap::kNone;
  if (mishap == Mishap::kDropRequest) return std::nullopt;
  v1::StreamSegmentsResponse response;
  response.set_session(key.session);
  response.set_index(key.index);
  if (rejected_.count(key) > 0) {
    response.set_verdict(v1::StreamSegmentsResponse::REJECTED);
    auto* violation = response.add_violations();
    violation->set_field("keyframes[0].q_gi");
    violation->set_description("norm is 0.9; send a unit quaternion");
  } else {
    response.set_verdict(stored_.insert(key).second
                             ? v1::StreamSegmentsResponse::STORED
                             : v1::StreamSegmentsResponse::DUPLICATE);
  }
  if (mishap == Mishap::kDropAcknowledgement) return std::nullopt;
  if (mishap == Mishap::kForeignAcknowledgement) response.set_session("other");
  if (mishap == Mishap::kUnknownVerdict) {
    response.set_verdict(static_cast<v1::StreamSegmentsResponse::Verdict>(99));
  }
  return response;
}

grpc::Status FakeDaemon::WatchCalibration(
    grpc::ServerContext* context,
    const v1::WatchCalibrationRequest* request,
    grpc::ServerWriter<v1::Calibration>* writer) {
  EXPECT_EQ(request->parent(), "rigs/device");
  std::optional<std::pair<std::int64_t, v1::Verdict::Kind>> told;
  while (!context->IsCancelled()) {
    v1::Calibration next;
    {
      std::unique_lock lock(mutex_);
      if (!stream_status_.ok()) return stream_status_;
      // Polls, for a context tells of its end to nobody who waits.
      changed_.wait_for(lock, std::chrono::milliseconds(5));
      if (!active_.has_value()) continue;
      if (told == std::pair(active_->version(), active_->verdict().kind())) {
        continue;
      }
      next = *active_;
    }
    if (!writer->Write(next)) break;
    told = {next.version(), next.verdict().kind()};
    {
      std::lock_guard lock(mutex_);
      watched_.insert(next.version());
    }
    changed_.notify_all();
  }
  return grpc::Status::CANCELLED;
}

}  // namespace selfcal::client
