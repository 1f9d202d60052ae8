// Listens to what other processes announce (LISTEN and NOTIFY), on a connection
// of its own.
#pragma once

#include <chrono>
#include <string>
#include <thread>

#include "server/store/driver/driver.h"
#include "server/store/postgres/postgres_connection.h"

namespace selfcal::server {

class PostgresListener final : public Listener {
 public:
  // Announcements may be missed without a sign, as through a pooler that shares
  // one connection among sessions: so they are supposed to be at this interval.
  static constexpr std::chrono::milliseconds kPoll = std::chrono::minutes(1);

  // Leaves out what connections with this origin announce.
  PostgresListener(std::string uri,
                   std::string origin,
                   Heard heard,
                   std::chrono::milliseconds poll = kPoll);
  ~PostgresListener() override;
  PostgresListener(const PostgresListener&) = delete;
  PostgresListener& operator=(const PostgresListener&) = delete;

 private:
  void Run();
  // Listens until the connection is lost, or the object ends.
  absl::Status ListenOnce();
  // Waits for the socket, or so long; false if the object ends.
  bool Wait(int socket, int timeout_ms) const;
  void PassOn(PGconn* handle) const;

  const std::string uri_;
  const std::string origin_;
  const Heard heard_;
  const std::chrono::milliseconds poll_;
  const int wake_;  // an eventfd: the object ends
  std::thread thread_;
};

}  // namespace selfcal::server
