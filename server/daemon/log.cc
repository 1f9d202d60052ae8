#include "server/daemon/log.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "proto/safe_text.h"

namespace selfcal::server {
namespace {

// Passes messages on as one line without control characters: what they quote
// must not look like another message, or reach a terminal.
class SafeFormatter final : public spdlog::formatter {
 public:
  explicit SafeFormatter(std::unique_ptr<spdlog::formatter> inner)
      : inner_(std::move(inner)) {}

  void format(const spdlog::details::log_msg& message,
              spdlog::memory_buf_t& to) override {
    const std::string text =
        SafeLine({message.payload.data(), message.payload.size()});
    spdlog::details::log_msg safe = message;
    safe.payload = text;
    inner_->format(safe, to);
    message.color_range_start = safe.color_range_start;
    message.color_range_end = safe.color_range_end;
  }

  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<SafeFormatter>(inner_->clone());
  }

 private:
  const std::unique_ptr<spdlog::formatter> inner_;
};

class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message,
              spdlog::memory_buf_t& to) override {
    const auto time =
        std::chrono::time_point_cast<std::chrono::milliseconds>(message.time);
    const auto level = spdlog::level::to_string_view(message.level);
    nlohmann::ordered_json line;
    line["time"] =
        fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z",
                    fmt::gmtime(std::chrono::system_clock::to_time_t(time)),
                    time.time_since_epoch().count() % 1000);
    line["level"] = std::string_view(level.data(), level.size());
    line["message"] =
        std::string_view(message.payload.data(), message.payload.size());
    const std::string text = line.dump();
    to.append(text.data(), text.data() + text.size());
    to.push_back('\n');
  }

  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<JsonFormatter>();
  }
};

}  // namespace

void SetUpLog(const std::string& level, const std::string& format) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("selfcald"));
  std::unique_ptr<spdlog::formatter> formatter;
  if (format == "json") {
    formatter = std::make_unique<JsonFormatter>();
  } else {
    formatter = std::make_unique<spdlog::pattern_formatter>(
        "%Y-%m-%dT%H:%M:%S.%eZ %^%l%$ %v", spdlog::pattern_time_type::utc);
  }
  spdlog::set_formatter(std::make_unique<SafeFormatter>(std::move(formatter)));
  spdlog::flush_on(spdlog::level::trace);
  SetLogLevel(level);
}

void SetLogLevel(const std::string& level) {
  spdlog::set_level(spdlog::level::from_str(level));
}

}  // namespace selfcal::server
