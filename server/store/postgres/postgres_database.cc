#include "server/store/postgres/postgres_database.h"

#include <fmt/format.h>

#include <algorithm>
#include <future>
#include <random>
#include <utility>

#include "server/status/status_macros.h"
#include "server/store/driver/transaction.h"
#include "server/store/postgres/postgres_listener.h"

namespace selfcal::server {
namespace {

using Failure = PostgresConnection::Failure;

// A transaction that conflicts this often meets more than bad luck.
constexpr int kMaxAttempts = 10;
constexpr std::chrono::milliseconds kFirstDelay{2};
constexpr std::chrono::milliseconds kMaxDelay{200};

// While the server is down, a queue of writes does not wait for a connection
// each.
constexpr std::chrono::milliseconds kFailFast{250};

// A transaction that writes holds the lock on its rig. If its daemon is stopped
// or cut off, it ends when others take over the work (ReplicaOptions::lease),
// and those of its transactions that wait for the lock have ended before: each
// would hold it for as long again.
constexpr char kLimitWrites[] =
    "SET idle_in_transaction_session_timeout = '10s';"
    "SET lock_timeout = '5s'";

// Pages of lists take some ten milliseconds: what takes this long is a filter
// that no index serves.
constexpr char kLimitReads[] = "SET statement_timeout = '30s'";

std::vector<std::unique_ptr<PostgresConnection>> Unopened(int count) {
  return std::vector<std::unique_ptr<PostgresConnection>>(
      static_cast<std::size_t>(count));
}

// A number of its own for each thread that calls.
std::size_t NumberOfThread() {
  static std::atomic<std::size_t> next = 0;
  thread_local const std::size_t number = next++;
  return number;
}

// Of a random length, so that two that conflicted do not meet again.
void SleepBeforeAttempt(int attempt) {
  const auto longest =
      std::min(kMaxDelay, kFirstDelay * (1 << std::min(attempt, 10)));
  thread_local std::minstd_rand random{std::random_device{}()};
  std::uniform_int_distribution<std::int64_t> delay_us(
      0, std::chrono::microseconds(longest).count());
  std::this_thread::sleep_for(std::chrono::microseconds(delay_us(random)));
}

Database::Work InSnapshot(const Database::Work& query) {
  return [&query](Connection* db) -> absl::Status {
    const Snapshot snapshot(db);
    SELFCAL_RETURN_IF_ERROR(snapshot.status());
    return query(db);
  };
}

std::string NewOrigin() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}", random(), random());
}

}  // namespace

PostgresDatabase::PostgresDatabase(std::string uri, int writers, int readers)
    : uri_(std::move(uri)),
      origin_(NewOrigin()),
      for_callers_{kLimitReads, {}, {}, Unopened(readers)},
      for_service_{"", {}, {}, Unopened(kServiceReaders)} {
  for (int k = 0; k < writers; ++k) {
    Writer* const writer =
        writers_.emplace_back(std::make_unique<Writer>()).get();
    writer->thread = std::thread([this, writer] { RunWriter(writer); });
  }
}

PostgresDatabase::~PostgresDatabase() {
  for (const auto& writer : writers_) {
    {
      const std::lock_guard lock(writer->mutex);
      writer->stopping = true;
    }
    writer->arrived.notify_all();
  }
  for (const auto& writer : writers_) writer->thread.join();
}

absl::StatusOr<std::unique_ptr<PostgresConnection>>
PostgresDatabase::Connect() {
  {
    const std::lock_guard lock(failure_mutex_);
    if (!failure_.ok() &&
        std::chrono::steady_clock::now() < failed_at_ + kFailFast) {
      return failure_;
    }
  }
  auto opened = PostgresConnection::Open(uri_);
  if (opened.ok()) (*opened)->SetOrigin(origin_);
  const std::lock_guard lock(failure_mutex_);
  failure_ = opened.status();
  failed_at_ = std::chrono::steady_clock::now();
  return opened;
}

absl::Status PostgresDatabase::CarryOut(
    const Work& work,
    bool is_read,
    const std::string& settings,
    std::unique_ptr<PostgresConnection>* connection) {
  for (int attempt = 1;; ++attempt) {
    if (*connection == nullptr || (*connection)->lost()) {
      connection->reset();  // before the next one counts
      SELFCAL_ASSIGN_OR_RETURN(auto opened, Connect());
      if (!settings.empty()) {
        SELFCAL_RETURN_IF_ERROR(opened->Execute(settings));
      }
      *connection = std::move(opened);
    }
    PostgresConnection* const db = connection->get();
    db->ClearFailure();
    absl::Status status = RunGuarded(work, db);
    if (db->in_transaction()) db->Execute("ROLLBACK").IgnoreError();
    const Failure failure = db->failure();
    const bool again = failure == Failure::kConflict ||
                       failure == Failure::kLost ||
                       (failure == Failure::kUnknown && is_read);
    if (status.ok() || !again || attempt == kMaxAttempts) return status;
    ++retries_;
    if (failure == Failure::kConflict) SleepBeforeAttempt(attempt);
  }
}

void PostgresDatabase::BeginWrite(Work work, Done done) {
  Writer* const writer = writers_[NumberOfThread() % writers_.size()].get();
  {
    const std::lock_guard lock(writer->mutex);
    writer->queue.push_back({std::move(work), std::move(done)});
  }
  writer->arrived.notify_all();
}

absl::Status PostgresDatabase::Write(Work work) {
  // Shared, because this function may return before set_value has.
  const auto committed = std::make_shared<std::promise<absl::Status>>();
  BeginWrite(std::move(work), [committed](const absl::Status& status) {
    committed->set_value(status);
  });
  return committed->get_future().get();
}

void PostgresDatabase::RunWriter(Writer* writer) {
  std::unique_lock lock(writer->mutex);
  for (;;) {
    writer->arrived.wait(
        lock, [&] { return writer->stopping || !writer->queue.empty(); });
    if (writer->queue.empty()) return;
    {
      const Job job = std::move(writer->queue.front());
      writer->queue.pop_front();
      lock.unlock();
      job.done(CarryOut(job.work, false, kLimitWrites, &writer->connection));
    }  // releases its memory before taking the lock
    lock.lock();
  }
}

absl::Status PostgresDatabase::Read(const Work& query) {
  return ReadWith(InSnapshot(query), &for_callers_);
}

absl::Status PostgresDatabase::ReadOne(const Work& query) {
  return ReadWith(query, &for_callers_);
}

absl::Status PostgresDatabase::ReadForService(const Work& query) {
  return ReadWith(InSnapshot(query), &for_service_);
}

absl::Status PostgresDatabase::ReadWith(const Work& query, Readers* readers) {
  std::unique_ptr<PostgresConnection> connection;
  {
    std::unique_lock lock(readers->mutex);
    readers->returned.wait(lock, [&] { return !readers->idle.empty(); });
    connection = std::move(readers->idle.back());
    readers->idle.pop_back();
  }
  const absl::Status status =
      CarryOut(query, true, readers->settings, &connection);
  {
    const std::lock_guard lock(readers->mutex);
    readers->idle.push_back(std::move(connection));
  }
  readers->returned.notify_one();
  return status;
}

absl::StatusOr<std::unique_ptr<Connection>> PostgresDatabase::OpenReader() {
  SELFCAL_ASSIGN_OR_RETURN(std::unique_ptr<Connection> reader, Connect());
  SELFCAL_RETURN_IF_ERROR(
      reader->Execute("SET default_transaction_read_only = on"));
  return reader;
}

std::unique_ptr<Listener> PostgresDatabase::Listen(
    const Listener::Heard& heard) {
  return std::make_unique<PostgresListener>(uri_, origin_, heard);
}

}  // namespace selfcal::server
