// The files and the socket between the daemon and its worker.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace selfcal::server {

// The worker's file descriptors, besides standard error.
inline constexpr int kJobFile = 0;
inline constexpr int kProgressFile = 3;  // a packet socket
inline constexpr int kResultFile = 4;
inline constexpr int kFirstFreeFile = 5;

// Limit on the size of a packet; progress with kMaxCameras cameras takes a
// fifth of it.
inline constexpr std::size_t kMaxProgressBytes = 64 << 10;

// Write or read the whole file, from its start, whatever its position is. Throw
// std::system_error.
void WriteWhole(int file, std::string_view bytes);
std::string ReadWhole(int file);

}  // namespace selfcal::server
