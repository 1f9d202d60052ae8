#include "server/worker/channel.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <system_error>

namespace selfcal::server {
namespace {

[[noreturn]] void Fail(const char* what) {
  throw std::system_error(errno, std::generic_category(), what);
}

// Before the bytes of a part.
using PartSize = std::uint64_t;

Sending SendBytes(int socket,
                  std::string_view bytes,
                  const std::function<bool()>& interrupted) {
  while (!bytes.empty()) {
    if (interrupted && interrupted()) return Sending::kInterrupted;
    const ssize_t sent =
        send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent >= 0) {
      bytes.remove_prefix(sent);
    } else if (errno == EAGAIN) {
      pollfd polled{.fd = socket, .events = POLLOUT, .revents = 0};
      poll(&polled, 1, kPollMs);
    } else if (errno == EPIPE || errno == ECONNRESET) {
      return Sending::kNotRead;
    } else if (errno != EINTR) {
      Fail("cannot send a job");
    }
  }
  return Sending::kDone;
}

void ReceiveBytes(int socket, char* bytes, std::size_t size) {
  while (size > 0) {
    const ssize_t received = recv(socket, bytes, size, 0);
    if (received < 0 && errno == EINTR) continue;
    if (received < 0) Fail("cannot receive a job");
    if (received == 0) throw std::runtime_error("the job is not complete");
    bytes += received;
    size -= received;
  }
}

}  // namespace

Sending SendPart(int socket,
                 std::string_view part,
                 const std::function<bool()>& interrupted) {
  std::array<char, sizeof(PartSize)> header{};
  const PartSize size = part.size();
  std::memcpy(header.data(), &size, sizeof(size));
  const Sending sent =
      SendBytes(socket, {header.data(), header.size()}, interrupted);
  return sent == Sending::kDone ? SendBytes(socket, part, interrupted) : sent;
}

std::optional<std::string> ReceivePart(int socket) {
  std::array<char, sizeof(PartSize)> header{};
  ReceiveBytes(socket, header.data(), header.size());
  PartSize size = 0;
  std::memcpy(&size, header.data(), sizeof(size));
  if (size == 0) return std::nullopt;
  std::string part(size, '\0');
  ReceiveBytes(socket, part.data(), part.size());
  return part;
}

void WriteWhole(int file, std::string_view bytes) {
  off_t at = 0;
  while (!bytes.empty()) {
    const ssize_t written = pwrite(file, bytes.data(), bytes.size(), at);
    if (written < 0) {
      if (errno == EINTR) continue;
      Fail("cannot write a result");
    }
    bytes.remove_prefix(written);
    at += written;
  }
}

std::string ReadWhole(int file) {
  struct stat state {};
  if (fstat(file, &state) != 0) Fail("cannot read a result");
  std::string bytes(state.st_size, '\0');
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t read = pread(file,
                               bytes.data() + done,
                               bytes.size() - done,
                               static_cast<off_t>(done));
    if (read < 0 && errno == EINTR) continue;
    if (read <= 0) Fail("cannot read a result");
    done += read;
  }
  return bytes;
}

}  // namespace selfcal::server
