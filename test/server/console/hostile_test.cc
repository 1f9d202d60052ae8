// What comes from the network ends no more than its own connection.
#include <random>

#include "test/promise.h"
#include "test/server/console/console_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

class HostileTest : public ConsoleTest {
 protected:
  void ExpectServing() { EXPECT_EQ(Get("/api/v1/rigs").status, 200); }
  // Connections that were dropped are counted until the console has seen it.
  void ExpectServingOnceTheyAreGone() {
    EXPECT_TRUE(Eventually([this] { return Get("/").status == 200; }));
    ExpectServing();
  }
};

TEST_F(HostileTest, RequestsThatAreNone) {
  constexpr int kNoAnswer = 0;
  const std::string rest =
      " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n";
  const std::pair<std::string, int> requests[] = {
      {"\r\n\r\n", kNoAnswer},
      {"GET\r\n\r\n", kNoAnswer},
      {"GET / HTTP/9.9\r\n\r\n", 505},
      {"BREW /pot" + rest + "\r\n", 405},
      {"GET /%00%ff%zz/api/v1" + rest + "\r\n", 200},  // a page
      {"GET /api/v1/rigs/%2e%2e%2f" + rest + "\r\n", 404},
      {"GET /api/v1/rigs?filter=%ff%fe" + rest + "\r\n", 400},
      {"POST /api/v1/rigs" + rest + "Content-Length: -5\r\n\r\n", 400},
      {"POST /" + rest +
           "Transfer-Encoding: chunked\r\nX-Selfcal-Console: 1\r\n\r\nzz\r\n",
       400},
      {std::string(64, '\0') + "\r\n\r\n", kNoAnswer},
  };
  for (const auto& [bytes, status] : requests) {
    EXPECT_EQ(Exchange(bytes).status, status) << bytes;
    ExpectServing();
  }
}

TEST_F(HostileTest, NoiseIsSurvived) {
  std::mt19937 random(7);
  const std::string alphabet =
      "GET POST /api/v1/rigs?&=%:~\r\n\t {}[]\"\\HTTP/1.1 Host: localhost";
  for (int i = 0; i < 200; ++i) {
    std::string bytes = i % 2 == 0 ? "GET /api/v1/rigs/" : "";
    const std::size_t size = 1 + random() % 300;
    while (bytes.size() < size) bytes += alphabet[random() % alphabet.size()];
    Wire wire(port());
    wire.Send(bytes);
  }
  ExpectServingOnceTheyAreGone();
}

// A promise: a stop while malformed requests come ends no more than the
// console.
TEST_F(HostileTest, MalformedRequestsDuringAStopAreSurvived) {
  Promise promise("malformed requests during a stop end nothing");
  for (int trials = Trials(200); promise.trials < trials; ++promise.trials) {
    std::vector<std::unique_ptr<Wire>> wires;
    for (int i = 0; i <= promise.trials % 40; ++i) {
      wires.push_back(std::make_unique<Wire>(port()));
      wires.back()->Send("GET / HTTP/1.1\r\n\r\n");  // names no host
    }
    Open(Role::kRead);
    promise.lost += Get("/api/v1/rigs").status != 200;
  }
}

TEST_F(HostileTest, TooMuchIsRefused) {
  const Reply body = Post("/api/v1/rigs", std::string(100 << 10, 'x'));
  EXPECT_EQ(body.status, 413) << body.body;
  const Reply header = Exchange("GET / HTTP/1.1\r\nHost: localhost\r\nX: " +
                                std::string(100 << 10, 'x') + "\r\n\r\n");
  EXPECT_GE(header.status, 400);
  const Reply path = Get("/" + std::string(60 << 10, 'x'));
  EXPECT_GE(path.status, 400);
  ExpectServing();
}

TEST_F(HostileTest, DeepJsonIsRefused) {
  Open(Role::kAdminister);
  AddRig("r");
  const Reply reply =
      Post("/api/v1/rigs/r/calibrations/1:activate", std::string(30'000, '['));
  EXPECT_EQ(reply.status, 400) << reply.body;
  ExpectServing();
}

TEST_F(HostileTest, ErrorsQuoteBytesThatAreNoText) {
  const Reply reply = Get("/api/v1/rigs/r%ff/segments/%fe~1");
  EXPECT_EQ(reply.status, 400) << reply.body;
  EXPECT_FALSE(reply.json().is_discarded()) << reply.body;
}

TEST_F(HostileTest, ConnectionsBeyondTheLimitDoNotHoldUpTheFirst) {
  {
    std::vector<std::unique_ptr<Wire>> held;
    for (int i = 0; i < 100; ++i) {
      held.push_back(std::make_unique<Wire>(port()));
      held.back()->Send("GET / HTTP/1.1\r\nHost:");
    }
    held[0]->Send(" localhost\r\nConnection: close\r\n\r\n");
    EXPECT_NE(held[0]->ReadUntil("").find("200 OK"), std::string::npos);
  }
  ExpectServingOnceTheyAreGone();
}

}  // namespace
}  // namespace selfcal::server
