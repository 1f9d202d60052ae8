// A real console on a port of the loopback over a real SQLite store, and a
// client that sends what it is told to.
#pragma once

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>

#include "server/api/api.h"
#include "server/api/event_feed.h"
#include "server/console/console.h"
#include "test/server/grpc/fake_pipeline.h"
#include "test/server/store/sqlite/open_sqlite_store.h"
#include "test/server/test_records.h"
#include "test/server/test_segments.h"

namespace selfcal::server {

// A TCP connection to the loopback.
class Wire {
 public:
  explicit Wire(int port) : file_(socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval patience{20, 0};
    setsockopt(file_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    connected_ =
        connect(
            file_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
  }
  ~Wire() { close(file_); }
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  bool connected() const { return connected_; }
  void Send(const std::string& bytes) const {
    send(file_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }
  // Until the text has come, or the other end has closed.
  std::string ReadUntil(const std::string& text) {
    char buffer[4096];
    while (text.empty() || read_.find(text) == read_.npos) {
      const ssize_t n = recv(file_, buffer, sizeof(buffer), 0);
      if (n <= 0) break;
      read_.append(buffer, static_cast<std::size_t>(n));
    }
    return read_;
  }

 private:
  int file_;
  bool connected_ = false;
  std::string read_;
};

struct Reply {
  int status = 0;  // 0: none came
  std::string head;
  std::string body;

  nlohmann::json json() const {
    return nlohmann::json::parse(body, nullptr, false);
  }
  std::string code() const { return json().value("code", "none"); }
};

class ConsoleTest : public ::testing::Test {
 protected:
  static constexpr char kConsoleHeader[] = "X-Selfcal-Console: 1\r\n";

  ConsoleTest() {
    std::string folder = std::filesystem::temp_directory_path() / "scw-XXXXXX";
    folder_ = mkdtemp(folder.data());
    auto store = OpenSqliteStore(folder_ / "test.db");
    if (!store.ok()) throw std::runtime_error(store.status().ToString());
    store_ = *std::move(store);
    domain_.emplace(store_.get());
    pipeline_ = std::make_unique<FakePipeline>(&*domain_);
    feed_ = std::make_unique<EventFeed>(store_.get(), nullptr);
    api_.emplace(&*domain_,
                 pipeline_.get(),
                 feed_.get(),
                 ApiOptions{.program_version = "test"});
    Open(Role::kRead);
  }
  ~ConsoleTest() override {
    console_.reset();
    api_.reset();
    feed_.reset();
    std::filesystem::remove_all(folder_);
  }

  void Open(Role role) {
    console_.reset();
    auto console = MakeConsole(&*api_, {"127.0.0.1:0", role, {}});
    if (!console.ok()) throw std::runtime_error(console.status().ToString());
    console_ = *std::move(console);
  }

  int port() const {
    return std::stoi(
        console_->url().substr(std::string("http://127.0.0.1:").size()));
  }

  // Sends these bytes, and reads until the other end closes.
  Reply Exchange(const std::string& bytes) const {
    Wire wire(port());
    wire.Send(bytes);
    return Parse(wire.ReadUntil(""));
  }

  static Reply Parse(const std::string& answer) {
    Reply reply;
    const auto end = answer.find("\r\n\r\n");
    if (!answer.starts_with("HTTP/1.") || end == answer.npos) return reply;
    reply.status = std::stoi(answer.substr(9, 3));
    reply.head = answer.substr(0, end);
    reply.body = answer.substr(end + 4);
    return reply;
  }

  Reply Get(const std::string& path,
            const std::string& host = "127.0.0.1") const {
    return Exchange("GET " + path + " HTTP/1.1\r\nHost: " + host +
                    "\r\nConnection: close\r\n\r\n");
  }

  Reply Post(const std::string& path,
             const std::string& body,
             const std::string& headers = kConsoleHeader) const {
    return Change("POST", path, body, headers);
  }

  Reply Change(const std::string& method,
               const std::string& path,
               const std::string& body,
               const std::string& headers = kConsoleHeader) const {
    return Exchange(method + " " + path +
                    " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" +
                    headers + "Content-Length: " + std::to_string(body.size()) +
                    "\r\n\r\n" + body);
  }

  Rig AddRig(const std::string& id) {
    const Rig rig = TestRig(id);
    const auto created = domain_->CreateRig(rig);
    EXPECT_TRUE(created.ok()) << created.status();
    return rig;
  }

  // A second version of the rig, active.
  void AddVersion(const Rig& rig) {
    const MotionSegment segment = TestSegments(rig, 1)[0];
    ASSERT_TRUE(domain_->PutSegment(rig.id, segment).ok());
    SegmentInformation information = TestInformation(rig, 9);
    information.unobserved = {{{{"imu.gyro.scale.x", 1}}, 0.5}};
    information.groups[0].unobserved = information.unobserved;
    ASSERT_TRUE(domain_->CommitScore(rig.id, segment.key, information).ok());
    const auto run = domain_->CreateManualRun(rig.id);
    ASSERT_TRUE(run.ok()) << run.status();
    ASSERT_TRUE(domain_->BeginRun(rig.id, run->run).ok());
    const auto finished =
        domain_->FinishRun(rig.id, run->run, TestCalibration(rig, *run));
    ASSERT_TRUE(finished.ok()) << finished.status();
  }

  std::filesystem::path folder_;
  std::unique_ptr<Store> store_;
  std::optional<Domain> domain_;
  std::unique_ptr<FakePipeline> pipeline_;
  std::unique_ptr<EventFeed> feed_;
  std::optional<Api> api_;
  std::unique_ptr<Console> console_;
};

}  // namespace selfcal::server
