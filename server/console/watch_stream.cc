#include "server/console/watch_stream.h"

#include <utility>

#include "server/console/json.h"
#include "server/http/error_response.h"

namespace selfcal::server {
namespace {

class WatchStream final : public HttpStream {
 public:
  WatchStream(std::shared_ptr<WatchQueue> queue,
              std::shared_ptr<void> subscription)
      : queue_(std::move(queue)), subscription_(std::move(subscription)) {}

  std::optional<std::string> Take(std::chrono::milliseconds timeout) override {
    const WatchQueue::Taken taken = queue_->Take(timeout);
    if (taken.update == nullptr) {
      if (!taken.ended) return "";
      if (taken.status.ok() || std::exchange(told_, true)) return std::nullopt;
      return ErrorEvent(taken.status);
    }
    const auto update = taken.update();
    if (update.ok()) {
      return *update != nullptr ? MessageEvent((*update)->message()) : "";
    }
    queue_->Close(update.status());
    return "";
  }

  void Close() override { queue_->Close(); }

 private:
  const std::shared_ptr<WatchQueue> queue_;
  const std::shared_ptr<void> subscription_;
  bool told_ = false;  // the error that has ended it
};

}  // namespace

absl::StatusOr<std::shared_ptr<HttpStream>> OpenWatchStream(
    const Method& method, const Call& call, const Message& request) {
  auto queue = std::make_shared<WatchQueue>();
  auto subscription =
      std::get<WatchHandler>(method.handler)(call, request, queue);
  if (!subscription.ok()) return subscription.status();
  return std::make_shared<WatchStream>(std::move(queue),
                                       *std::move(subscription));
}

}  // namespace selfcal::server
