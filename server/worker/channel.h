// The files and the socket between the daemon and its worker.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace selfcal::server {

// The worker's file descriptors, besides standard error.
inline constexpr int kJobFile = 0;       // a stream socket
inline constexpr int kProgressFile = 3;  // a packet socket
inline constexpr int kResultFile = 4;
inline constexpr int kFirstFreeFile = 5;

// Limit on the size of a packet; progress with kMaxCameras cameras takes a
// fifth of it.
inline constexpr std::size_t kMaxProgressBytes = 64 << 10;

// Interval at which a process that waits for the other one looks whether it is
// still needed.
inline constexpr int kPollMs = 20;

// A job is sent in parts, and ends with an empty one.
enum class Sending {
  kDone,
  kInterrupted,
  kNotRead,  // the other process does not read any more
};
// `interrupted` may be null, and is called every kPollMs at least. Throws
// std::system_error.
Sending SendPart(int socket,
                 std::string_view part,
                 const std::function<bool()>& interrupted);
// Blocks until a part has arrived; returns nullopt if it is the end. Throws
// std::runtime_error if the other process has ended before.
std::optional<std::string> ReceivePart(int socket);

// Write or read the whole file, from its start, whatever its position is. Throw
// std::system_error.
void WriteWhole(int file, std::string_view bytes);
std::string ReadWhole(int file);

}  // namespace selfcal::server
