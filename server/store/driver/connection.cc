#include <cstddef>
#include <exception>
#include <new>
#include <utility>

#include "server/store/driver/driver.h"

namespace selfcal::server {
namespace {

// Prepared statements that a connection keeps, a few kB each.
constexpr std::size_t kMaxPrepared = 128;

}  // namespace

absl::StatusOr<std::unique_ptr<PreparedStatement>> Connection::Take(
    std::string_view sql) {
  const auto found = prepared_.find(sql);
  if (found != prepared_.end() && found->second != nullptr) {
    return std::move(found->second);
  }
  // Allocates its place here, since Keep runs in a destructor.
  if (found == prepared_.end() && prepared_.size() < kMaxPrepared) {
    prepared_.emplace(sql, nullptr);
  }
  return Prepare(sql);
}

void Connection::Keep(std::unique_ptr<PreparedStatement> prepared) {
  if (prepared == nullptr) return;
  const auto place = prepared_.find(prepared->sql());
  if (place == prepared_.end() || place->second != nullptr) return;
  prepared->Reset();
  place->second = std::move(prepared);
}

absl::Status RunGuarded(const Database::Work& work, Connection* connection) {
  try {
    return work(connection);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("memory is short: try again later");
  } catch (const std::exception& error) {
    return absl::InternalError(error.what());
  }
}

}  // namespace selfcal::server
