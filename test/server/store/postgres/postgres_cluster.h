// A PostgreSQL server for tests: a cluster of its own in a temporary folder,
// which only a unix socket there reaches. It ends with its object, or with the
// process.
//
// PostgreSQL refuses to run as root: then it runs as the user postgres, whom
// Debian's package creates.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "test/support/temp_folder.h"

namespace selfcal::server {

class PostgresCluster {
 public:
  // Why there can be none, e.g. that it is not installed; empty if there can.
  static std::string WhyNot();

  // Starts a server with these settings ("name=value"), which by default does
  // not sync to disk. Throws std::runtime_error, with its log, if it fails.
  explicit PostgresCluster(std::vector<std::string> settings = {"fsync=off"});
  ~PostgresCluster();
  PostgresCluster(const PostgresCluster&) = delete;
  PostgresCluster& operator=(const PostgresCluster&) = delete;

  void Start();
  // Sends a signal to the server and waits for its end: SIGINT disconnects the
  // clients, SIGQUIT is a crash that the next start recovers from.
  void Stop(int signal);

  // The address of a database, for its superuser.
  std::string Uri(const std::string& database) const;
  // Creates a database, as a copy of another one; false if it exists. Throws
  // std::runtime_error for other errors.
  bool Create(const std::string& database,
              const std::string& original = "template0") const;
  // Removes a database with its connections, if it exists.
  void Drop(const std::string& database) const;

 private:
  pid_t Run(const std::vector<std::string>& command) const;
  std::string Log() const;

  // Its log is too large for memory.
  const TempFolder folder_{std::filesystem::temp_directory_path()};
  const std::vector<std::string> settings_;
  const pid_t owner_;  // a fork of it leaves the server alone
  pid_t server_ = 0;   // 0: none runs
};

}  // namespace selfcal::server
