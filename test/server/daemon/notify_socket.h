// The service manager's end of sd_notify(3), for tests.
#pragma once

#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <string>

namespace selfcal::server {

class NotifySocket {
 public:
  // `path` has fewer than 100 characters.
  explicit NotifySocket(const std::string& path)
      : file_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof(address.sun_path) - 1);
    // Where it fails no message comes.
    static_cast<void>(
        bind(file_, reinterpret_cast<sockaddr*>(&address), sizeof(address)));
    const timeval limit{60, 0};
    setsockopt(file_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
  }
  ~NotifySocket() { close(file_); }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  // The next message; empty if none comes within a minute.
  std::string Next() {
    char buffer[4096];
    const ssize_t size = recv(file_, buffer, sizeof(buffer), 0);
    return size <= 0 ? "" : std::string(buffer, static_cast<size_t>(size));
  }

  // Whether a message with the text comes.
  bool Hears(const std::string& text) {
    for (std::string next = Next(); !next.empty(); next = Next()) {
      if (next.find(text) != next.npos) return true;
    }
    return false;
  }

 private:
  int file_;
};

}  // namespace selfcal::server
