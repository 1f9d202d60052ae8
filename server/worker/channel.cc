#include "server/worker/channel.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace selfcal::server {
namespace {

[[noreturn]] void Fail(const char* what) {
  throw std::system_error(errno, std::generic_category(), what);
}

}  // namespace

void WriteWhole(int file, std::string_view bytes) {
  off_t at = 0;
  while (!bytes.empty()) {
    const ssize_t written = pwrite(file, bytes.data(), bytes.size(), at);
    if (written < 0) {
      if (errno == EINTR) continue;
      Fail("cannot write a job or result");
    }
    bytes.remove_prefix(written);
    at += written;
  }
}

std::string ReadWhole(int file) {
  struct stat state {};
  if (fstat(file, &state) != 0) Fail("cannot read a job or result");
  std::string bytes(state.st_size, '\0');
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t read = pread(file,
                               bytes.data() + done,
                               bytes.size() - done,
                               static_cast<off_t>(done));
    if (read < 0 && errno == EINTR) continue;
    if (read <= 0) Fail("cannot read a job or result");
    done += read;
  }
  return bytes;
}

}  // namespace selfcal::server
