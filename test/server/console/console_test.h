// A real console on a port of the loopback over a real SQLite store, and a
// client that sends what it is told to.
#pragma once

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>

#include "server/api/api.h"
#include "server/console/console.h"
#include "test/server/served_store.h"

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

class ConsoleTest : public ServedStore {
 protected:
  static constexpr char kConsoleHeader[] = "X-Selfcal-Console: 1\r\n";

  ConsoleTest() {
    api_.emplace(&*domain_,
                 pipeline_.get(),
                 &feed_,
                 ApiOptions{.program_version = "test"});
    Open(Role::kRead);
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

  std::optional<Api> api_;
  std::unique_ptr<Console> console_;
};

}  // namespace selfcal::server
