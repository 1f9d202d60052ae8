#include "server/store/postgres/postgres_listener.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <string_view>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/driver/statement.h"

namespace selfcal::server {
namespace {

constexpr int kFirstRetry_ms = 100;
constexpr int kLastRetry_ms = 5000;
// A connection that is silent for so long is asked whether it is alive.
constexpr std::chrono::milliseconds kSilence = std::chrono::seconds(10);

struct Free {
  void operator()(PGnotify* notice) const { PQfreemem(notice); }
};

}  // namespace

PostgresListener::PostgresListener(std::string uri,
                                   std::string origin,
                                   Heard heard,
                                   std::chrono::milliseconds poll)
    : uri_(std::move(uri)),
      origin_(std::move(origin)),
      heard_(std::move(heard)),
      poll_(poll),
      wake_(eventfd(0, EFD_CLOEXEC)),
      thread_([this] { Run(); }) {}

PostgresListener::~PostgresListener() {
  eventfd_write(wake_, 1);
  thread_.join();
  close(wake_);
}

bool PostgresListener::Wait(int socket, int timeout_ms) const {
  pollfd waited[] = {{wake_, POLLIN, 0}, {socket, POLLIN, 0}};
  poll(waited, socket < 0 ? 1 : 2, timeout_ms);
  return waited[0].revents == 0;
}

void PostgresListener::Run() {
  int retry_ms = kFirstRetry_ms;
  do {
    if (ListenOnce().ok()) {
      retry_ms = kFirstRetry_ms;
    } else {
      retry_ms = std::min(2 * retry_ms, kLastRetry_ms);
    }
  } while (Wait(-1, retry_ms));
}

absl::Status PostgresListener::ListenOnce() {
  SELFCAL_ASSIGN_OR_RETURN(const auto connection,
                           PostgresConnection::Open(uri_));
  SELFCAL_ASSIGN_OR_RETURN(const std::string channel, connection->Channel());
  SELFCAL_RETURN_IF_ERROR(connection->Execute("LISTEN " + channel));
  PGconn* const handle = connection->handle();
  auto next_poll = std::chrono::steady_clock::now();
  do {
    const auto now = std::chrono::steady_clock::now();
    if (now >= next_poll) {
      heard_(std::nullopt);
      next_poll = now + poll_;
    }
    // The answer also shows that the connection is alive, and brings what was
    // announced.
    if (!connection->Execute("SELECT 1").ok()) break;
    PassOn(handle);
  } while (Wait(PQsocket(handle),
                static_cast<int>(std::min(kSilence, poll_).count())));
  return absl::OkStatus();
}

void PostgresListener::PassOn(PGconn* handle) const {
  while (const std::unique_ptr<PGnotify, Free> notice{PQnotifies(handle)}) {
    const std::string_view text = notice->extra;
    const std::size_t space = text.find(' ');
    if (space == std::string_view::npos) continue;
    if (text.substr(0, space) == origin_) continue;
    heard_(std::string(text.substr(space + 1)));
  }
}

}  // namespace selfcal::server
