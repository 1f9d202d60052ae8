#include "client/selfcal/send_window.h"

#include <algorithm>
#include <cassert>
#include <utility>

namespace selfcal::client {

void SendWindow::Append(EncodedSegment&& segment) {
  segments_.push_back(std::move(segment));
}

void SendWindow::Open() {
  in_flight_ = 0;
  open_ = true;
}

bool SendWindow::CanSend() const {
  return open_ && in_flight_ < std::min(max_unacknowledged_, segments_.size());
}

std::shared_ptr<const v1::StreamSegmentsRequest> SendWindow::Next() {
  assert(CanSend());
  const EncodedSegment& next = segments_[in_flight_];
  ++in_flight_;
  if (in_flight_ <= sent_) {
    ++resent_;
  } else {
    sent_ = in_flight_;
  }
  return next.request;
}

std::optional<EncodedSegment> SendWindow::Acknowledge(const SegmentKey& key) {
  const auto end = segments_.begin() + static_cast<std::ptrdiff_t>(in_flight_);
  const auto found =
      std::find_if(segments_.begin(), end, [&](const EncodedSegment& segment) {
        return segment.key == key;
      });
  if (found == end) return std::nullopt;
  std::optional<EncodedSegment> acknowledged(std::move(*found));
  segments_.erase(found);
  --in_flight_;
  --sent_;
  return acknowledged;
}

std::optional<EncodedSegment> SendWindow::TakeOldest() {
  if (segments_.empty()) return std::nullopt;
  std::optional<EncodedSegment> oldest(std::move(segments_.front()));
  segments_.pop_front();
  in_flight_ -= std::min<std::size_t>(in_flight_, 1);
  sent_ -= std::min<std::size_t>(sent_, 1);
  return oldest;
}

std::size_t SendWindow::on_disk() const {
  return static_cast<std::size_t>(std::count_if(
      segments_.begin(), segments_.end(), [](const EncodedSegment& segment) {
        return segment.on_disk;
      }));
}

}  // namespace selfcal::client
