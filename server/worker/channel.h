// What lies between the daemon and its worker.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace selfcal::server {

// The worker's files, besides standard error.
inline constexpr int kJobFile = 0;
inline constexpr int kProgressFile = 3;  // a socket of packets
inline constexpr int kResultFile = 4;
inline constexpr int kFirstFreeFile = 5;

// Of one packet: kMaxCameras cameras take a fifth of it.
inline constexpr std::size_t kMaxProgressBytes = 64 << 10;

// From its start, wherever the file stands. Throw std::system_error.
void WriteWhole(int file, std::string_view bytes);
std::string ReadWhole(int file);

}  // namespace selfcal::server
