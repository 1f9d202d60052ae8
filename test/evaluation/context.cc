#include "test/evaluation/context.h"

#include <fmt/format.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

namespace selfcal {

Context::Context(const std::filesystem::path& out,
                 const std::string& experiment,
                 bool quick,
                 int threads)
    : experiment_(experiment),
      folder_(out / experiment),
      quick_(quick),
      threads_(threads),
      begin_(std::chrono::steady_clock::now()) {
  std::filesystem::remove_all(folder_);
  std::filesystem::create_directories(folder_);
}

void Context::Progress(const std::string& what) const {
  const std::chrono::duration<double> elapsed =
      std::chrono::steady_clock::now() - begin_;
  fmt::print(
      stderr, "{:>16} {:7.1f} s  {}\n", experiment_, elapsed.count(), what);
}

void Context::ForEach(int count, const std::function<void(int)>& work) const {
  std::atomic<int> next = 0;
  std::mutex mutex;
  std::exception_ptr failure;
  const auto run = [&] {
    for (int i = next++; i < count; i = next++) {
      try {
        work(i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        failure = std::current_exception();
      }
    }
  };
  std::vector<std::jthread> others;
  for (int i = 1; i < threads_; ++i) others.emplace_back(run);
  run();
  others.clear();
  if (failure) std::rethrow_exception(failure);
}

void Context::WriteTable(const std::string& name,
                         const ResultTable& table) const {
  Write(name + ".csv", table.Csv());
  Write(name + ".md", table.Markdown());
}

void Context::WritePlot(const std::string& name, const Plot& plot) const {
  Write(name + ".plot.json", Describe(plot));
}

void Context::AtMost(const std::string& name,
                     double value,
                     double bound,
                     const CheckOptions& options) {
  Check(
      {.name = name, .value = value, .kind = BoundKind::kAtMost, .high = bound},
      options);
}

void Context::AtLeast(const std::string& name,
                      double value,
                      double bound,
                      const CheckOptions& options) {
  Check(
      {.name = name, .value = value, .kind = BoundKind::kAtLeast, .low = bound},
      options);
}

void Context::Within(const std::string& name,
                     double value,
                     double low,
                     double high,
                     const CheckOptions& options) {
  Check({.name = name,
         .value = value,
         .kind = BoundKind::kWithin,
         .low = low,
         .high = high},
        options);
}

void Context::Check(Figure figure, const CheckOptions& options) {
  if (!std::isfinite(figure.value)) {
    throw std::invalid_argument(figure.name + " is not finite");
  }
  figure.experiment = experiment_;
  figure.unit = options.unit;
  figure.robust = options.robust;
  Progress(fmt::format("{} {} = {:.4g} {} ({})",
                       figure.Holds() ? "holds " : "MISSES",
                       figure.name,
                       figure.value,
                       figure.unit,
                       figure.Bound()));
  figures_.push_back(std::move(figure));
}

void Context::Write(const std::string& file, const std::string& text) const {
  std::ofstream stream(folder_ / file);
  stream << text;
  stream.close();
  if (!stream) {
    throw std::runtime_error("cannot write " + (folder_ / file).string());
  }
}

}  // namespace selfcal
