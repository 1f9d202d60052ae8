// Sustained acknowledged segments per second of the store, against the disk's
// own limit: the same bytes of compressed data, in as many commits of the same
// size, written and synced one after the other. They are appended to a file,
// which is what a store that grows asks of the disk, and then written over the
// same place, which spares the disk finding room; and appended twice, the
// second time in pieces of a checkpoint, which is what a write-ahead log asks
// of it. The time of the store is divided among its log, its database and the
// rest.
//
//   selfcal_store_benchmark --folder DIR [--streams N] [--segments N]
#include <fcntl.h>
#include <fmt/format.h>
#include <time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "core/simulation/simulate.h"
#include "core/simulation/trajectory.h"
#include "server/domain/domain.h"
#include "test/server/store/sqlite/fault_vfs.h"
#include "test/server/store/sqlite/open_sqlite_store.h"

namespace selfcal::server {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// As the service keeps under way for one stream.
constexpr int kUnderWay = 4;

struct Options {
  std::string folder;
  int streams = 16;
  int segments = 400;  // of all streams
  int rounds = 5;
};

double Seconds(Clock::duration time) {
  return std::chrono::duration<double>(time).count();
}

// One after the other, as a stream: at most kUnderWay unacknowledged.
class Stream {
 public:
  Stream(Domain* domain, std::string session)
      : domain_(domain), session_(std::move(session)) {}

  void Send(MotionSegment segment, int count) {
    segment.key.session = session_;
    for (int k = 0; k < count; ++k) {
      segment.key.index = k;
      {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return under_way_ < kUnderWay; });
        ++under_way_;
      }
      domain_->BeginPutSegment("bench", segment, [this](const auto& verdict) {
        const std::lock_guard lock(mutex_);
        if (!verdict.ok()) ++failed_;
        --under_way_;
        changed_.notify_all();
      });
    }
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return under_way_ == 0; });
  }
  int failed() const { return failed_; }

 private:
  Domain* const domain_;
  const std::string session_;
  std::mutex mutex_;
  std::condition_variable changed_;
  int under_way_ = 0;
  int failed_ = 0;
};

struct Measured {
  double seconds = 0;
  double cpu_seconds = 0;
  int commits = 0;
  std::int64_t bytes = 0;
  DiskUse log;
  DiskUse database;
};

double CpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) +
         1e-9 * static_cast<double>(time.tv_nsec);
}

// A checkpoint syncs the log before it and at its next start.
int Commits(const FaultVfs& vfs) {
  return vfs.syncs("-wal") - 2 * vfs.syncs("bench.db");
}

Measured MeasureStore(const Options& options, const MotionSegment& segment) {
  const std::string path = options.folder + "/bench.db";
  for (const char* suffix : {"", "-wal", "-shm"}) fs::remove(path + suffix);
  FaultVfs vfs;
  auto store = OpenSqliteStore(path);
  if (!store.ok()) throw std::runtime_error(store.status().ToString());
  Domain domain(store->get());
  if (!domain.CreateRig(HandheldRig("bench")).ok()) {
    throw std::runtime_error("cannot create the rig");
  }
  Measured measured;
  const int before = Commits(vfs);
  const double cpu_before = CpuSeconds();
  const auto start = Clock::now();
  std::atomic<int> failed = 0;
  std::vector<std::thread> threads;
  const int each = options.segments / options.streams;
  for (int k = 0; k < options.streams; ++k) {
    threads.emplace_back([&, k] {
      Stream stream(&domain, fmt::format("s{}", k));
      stream.Send(segment, each);
      failed += stream.failed();
    });
  }
  for (std::thread& thread : threads) thread.join();
  measured.seconds = Seconds(Clock::now() - start);
  measured.cpu_seconds = CpuSeconds() - cpu_before;
  measured.commits = Commits(vfs) - before;
  measured.log = vfs.use("-wal");
  measured.database = vfs.use("bench.db");
  if (failed > 0) throw std::runtime_error("a segment was refused");
  const auto stored = (*store)->GetSegment("bench", {"s0", 0});
  measured.bytes = stored->payload_bytes * each * options.streams;
  store->reset();
  return measured;
}

// Seconds of the disk for these commits: at the end of a file that grows, once
// more over the same place, and for the second write, of as many bytes at the
// end of another file with as many syncs as the database had.
struct Disk {
  double append_s = 0;
  double overwrite_s = 0;
  double second_s = 0;
};

class RawFile {
 public:
  explicit RawFile(const std::string& path)
      : path_(path), file_(open(path.c_str(), O_CREAT | O_RDWR, 0600)) {
    if (file_ < 0) throw std::runtime_error("cannot open " + path_);
  }
  ~RawFile() {
    close(file_);
    fs::remove(path_);
  }
  RawFile(const RawFile&) = delete;
  RawFile& operator=(const RawFile&) = delete;

  // Writes from the start of the file on; returns the seconds.
  double Write(std::int64_t bytes, int syncs) {
    const int pieces = std::max(1, syncs);
    const std::string piece(static_cast<std::size_t>(bytes / pieces), 'x');
    const auto start = Clock::now();
    for (int k = 0; k < pieces; ++k) {
      const auto offset =
          static_cast<off_t>(k) * static_cast<off_t>(piece.size());
      if (pwrite(file_, piece.data(), piece.size(), offset) !=
              static_cast<ssize_t>(piece.size()) ||
          fdatasync(file_) != 0) {
        throw std::runtime_error("cannot write " + path_);
      }
    }
    return Seconds(Clock::now() - start);
  }

 private:
  const std::string path_;
  const int file_;
};

Disk MeasureDisk(const Options& options, const Measured& of) {
  Disk disk;
  RawFile file(options.folder + "/bench.raw");
  disk.append_s = file.Write(of.bytes, of.commits);
  disk.overwrite_s = file.Write(of.bytes, of.commits);
  RawFile second(options.folder + "/second.raw");
  disk.second_s = second.Write(of.database.bytes, of.database.syncs);
  return disk;
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void Run(const Options& options) {
  SimulationOptions simulation;
  const auto trajectory = MakeHandheld(30.0, 1.0, 1);
  const Rig rig = HandheldRig("bench");
  const MotionSegment segment =
      Simulate(rig, rig.factory, rig.factory, *trajectory, "s", simulation)
          .segments.front();
  std::vector<double> appending;
  std::vector<double> overwriting;
  std::vector<double> twice;
  const int segments = options.segments / options.streams * options.streams;
  for (int round = 0; round < options.rounds; ++round) {
    const Measured store = MeasureStore(options, segment);
    const Disk disk = MeasureDisk(options, store);
    appending.push_back(disk.append_s / store.seconds);
    overwriting.push_back(disk.overwrite_s / store.seconds);
    twice.push_back((disk.append_s + disk.second_s) / store.seconds);
    fmt::print(
        "streams {:3d}: {:7.1f} segments/s, {:.2f} ms of CPU each, {:6.1f} "
        "commits/s of {:5.1f} segments, {:.0f} kB; disk alone appends {:7.1f} "
        "segments/s, ratio {:.2f}; overwrites {:7.1f}, ratio {:.2f}\n",
        options.streams,
        segments / store.seconds,
        1e3 * store.cpu_seconds / segments,
        store.commits / store.seconds,
        static_cast<double>(segments) / store.commits,
        1e-3 * static_cast<double>(store.bytes) / store.commits,
        segments / disk.append_s,
        appending.back(),
        segments / disk.overwrite_s,
        overwriting.back());
    fmt::print(
        "  of its time: log {:.0f} %, its syncs {:.0f} %, database {:.0f} %, "
        "its syncs {:.0f} %; wrote {:.2f} and {:.2f} times the bytes; the disk "
        "alone writing twice: ratio {:.2f}\n",
        100 * store.log.write_s / store.seconds,
        100 * store.log.sync_s / store.seconds,
        100 * store.database.write_s / store.seconds,
        100 * store.database.sync_s / store.seconds,
        static_cast<double>(store.log.bytes) / store.bytes,
        static_cast<double>(store.database.bytes) / store.bytes,
        twice.back());
    std::fflush(stdout);
  }
  fmt::print(
      "streams {:3d}: median ratio {:.2f} to appending, {:.2f} to "
      "overwriting, {:.2f} to appending twice\n",
      options.streams,
      Median(appending),
      Median(overwriting),
      Median(twice));
}

}  // namespace
}  // namespace selfcal::server

int main(int argc, char** argv) {
  CLI::App app("Durable segments per second, against the disk's own limit");
  selfcal::server::Options options;
  app.add_option("--folder", options.folder, "On the disk to measure")
      ->required()
      ->check(CLI::ExistingDirectory);
  app.add_option("--streams", options.streams)->check(CLI::Range(1, 1000));
  app.add_option("--segments", options.segments, "Of all streams together");
  app.add_option("--rounds", options.rounds)->check(CLI::Range(1, 1000));
  CLI11_PARSE(app, argc, argv);
  options.segments = std::max(options.segments, options.streams);
  try {
    selfcal::server::Run(options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  return 0;
}
