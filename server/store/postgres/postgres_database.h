// A PostgreSQL database shared by many threads.
//
// Writes run on a few threads, each with a connection of its own. All writes of
// one calling thread run on the same of them, so that they are carried out in
// their order; writes of different threads run at the same time, and the engine
// commits them together. Two that concern one rig exclude each other by the
// lock on its row (Dialect::for_update).
//
// Reads run on the thread of the caller, each in a snapshot, over one of a few
// other connections; they wait while all of these are in use.
//
// A transaction is carried out again if it conflicted with another one, or if
// the connection was lost before its commit was sent. If it was lost after
// that, the outcome is not known: the write is answered UNAVAILABLE, and the
// caller decides.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/store/driver/driver.h"
#include "server/store/postgres/postgres_connection.h"

namespace selfcal::server {

class PostgresDatabase final : public Database {
 public:
  static constexpr int kServiceReaders = 2;

  // Connections are opened when they are first needed, at most `writers` that
  // write, `readers` that read and kServiceReaders that read for the service,
  // besides those of OpenReader.
  PostgresDatabase(std::string uri, int writers, int readers);
  // Carries out the queued writes.
  ~PostgresDatabase() override;
  PostgresDatabase(const PostgresDatabase&) = delete;
  PostgresDatabase& operator=(const PostgresDatabase&) = delete;

  absl::Status Write(Work work) override;
  void BeginWrite(Work work, Done done) override;
  // UNAVAILABLE for a statement that takes too long.
  absl::Status Read(const Work& query) override;
  absl::Status ReadOne(const Work& query) override;
  absl::Status ReadForService(const Work& query) override;
  absl::StatusOr<std::unique_ptr<Connection>> OpenReader() override;
  std::unique_ptr<Listener> Listen(const Listener::Heard& heard) override;

  // Transactions that were carried out again.
  std::int64_t retries() const { return retries_; }

 private:
  struct Job {
    Work work;
    Done done;
  };
  // A thread that writes.
  struct Writer {
    std::mutex mutex;  // guards what follows, but for the connection
    std::condition_variable arrived;
    std::deque<Job> queue;
    bool stopping = false;
    std::unique_ptr<PostgresConnection> connection;  // of the thread alone
    std::thread thread;
  };
  // Connections that read.
  struct Readers {
    const std::string settings;  // SQL; empty: none
    std::mutex mutex;            // guards `idle`
    std::condition_variable returned;
    // Those that are not in use; null ones are not open yet.
    std::vector<std::unique_ptr<PostgresConnection>> idle;
  };

  absl::Status ReadWith(const Work& query, Readers* readers);
  void RunWriter(Writer* writer);
  absl::StatusOr<std::unique_ptr<PostgresConnection>> Connect();
  // Runs `work` on *connection, which is opened again, with `settings`, if it
  // is null or lost, as often as it takes; a read also if its outcome is not
  // known.
  absl::Status CarryOut(const Work& work,
                        bool is_read,
                        const std::string& settings,
                        std::unique_ptr<PostgresConnection>* connection);

  const std::string uri_;
  const std::string origin_;  // of what its connections announce
  std::vector<std::unique_ptr<Writer>> writers_;
  std::atomic<std::int64_t> retries_ = 0;

  Readers for_callers_;
  Readers for_service_;

  std::mutex failure_mutex_;  // guards what follows
  absl::Status failure_;      // of the last attempt to connect
  std::chrono::steady_clock::time_point failed_at_;
};

}  // namespace selfcal::server
