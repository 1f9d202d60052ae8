// selfcald as its operator meets it: certificates, settings, signals, metrics.
#include <gmock/gmock.h>
#include <yaml-cpp/yaml.h>

#include <atomic>
#include <cstdio>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>
#include <set>
#include <sstream>

#include "selfcal/v1/store_service.grpc.pb.h"
#include "test/promise.h"
#include "test/server/daemon/daemon_fixture.h"
#include "test/server/daemon/notify_socket.h"
#include "test/server/http_get.h"
#include "test/support/certificates.h"
#include "test/support/eventually.h"
#include "test/support/files.h"

namespace selfcal::server {
namespace {

using std::chrono::steady_clock;
using ::testing::HasSubstr;
using ::testing::Not;

class OperationTest : public DaemonTest {
 protected:
  std::string File(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }

  std::unique_ptr<Process> Check(const std::filesystem::path& state,
                                 const std::vector<std::string>& settings) {
    std::vector<std::string> arguments = {
        SELFCALD_PATH, "--state-dir", state.string(), "--check"};
    arguments.insert(arguments.end(), settings.begin(), settings.end());
    const std::string log = "check" + std::to_string(++checks_);
    return std::make_unique<Process>(arguments, folder_ / log);
  }

 private:
  int checks_ = 0;
};

TEST_F(OperationTest, CheckLooksAtTheSettingsAndEnds) {
  const auto good = Start({"--check"});
  EXPECT_EQ(good->Wait(), 0);
  EXPECT_FALSE(std::filesystem::exists(state_));

  const auto plain = Start({"--check", "--listen", "127.0.0.1:7447"});
  EXPECT_EQ(plain->Wait(), 1);
  EXPECT_THAT(plain->Log(), HasSubstr("insecure:host:port"));

  const auto metrics = Start({"--check", "--metrics", "0.0.0.0:9464"});
  EXPECT_EQ(metrics->Wait(), 1);
  EXPECT_THAT(metrics->Log(), HasSubstr("loopback"));

  const auto file = File("bad.toml", "max-rigs = 5\nmax-rig = 5\n");
  const auto misspelt = Start({"--check", "--config", file});
  EXPECT_EQ(misspelt->Wait(), 2);
  EXPECT_THAT(misspelt->Log(), HasSubstr(file + ":2:1: "));
}

TEST_F(OperationTest, AStartWithInvalidSettingsDoesNotTouchTheStateDirectory) {
  for (const std::vector<std::string>& settings :
       std::vector<std::vector<std::string>>{
           {"--metrics", "0.0.0.0:9464"},
           {"--console", "0.0.0.0:7448"},
           {"--listen", "127.0.0.1:7447"},
           {"--listen", "unix:/tmp/s", "--socket-group", "no such group"}}) {
    const auto daemon = Start(settings);
    EXPECT_EQ(daemon->Wait(), 1) << testing::PrintToString(settings);
    EXPECT_FALSE(std::filesystem::exists(state_))
        << testing::PrintToString(settings) << daemon->Log();
  }
}

TEST_F(OperationTest, AStopDoesNotWaitForABackupThatNobodyReads) {
  const auto daemon = StartAndWait();
  Rig rig = TestRig("r");
  rig.table_size = 100;  // keeps their data
  Stream(TestSegments(CreateRig(rig), 40));
  // A window that the backup does not fit into.
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  arguments.SetInt(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, 1 << 16);
  const auto stub = v1::StoreService::NewStub(
      grpc::CreateCustomChannel("unix:" + (state_ / "selfcald.sock").string(),
                                grpc::InsecureChannelCredentials(),
                                arguments));
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::BackupStoreResponse>>>
      unread;
  for (int k = 0; k < 3; ++k) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    unread.push_back(
        stub->BackupStore(contexts.back().get(), v1::BackupStoreRequest()));
    v1::BackupStoreResponse first;
    EXPECT_TRUE(unread.back()->Read(&first));
  }
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0) << daemon->Log();
  for (const auto& reader : unread) {
    v1::BackupStoreResponse rest;
    while (reader->Read(&rest)) {
    }
    EXPECT_FALSE(reader->Finish().ok());
  }
}

TEST_F(OperationTest, CheckRefusesWhatCannotStart) {
  const auto refuses = [this](const std::vector<std::string>& settings,
                              const std::string& why) {
    const auto check = Check(state_, settings);
    EXPECT_EQ(check->Wait(), 1) << why;
    EXPECT_THAT(check->Log(), HasSubstr(why));
  };
  const std::string file = File("file", "not a folder");
  for (const std::string& state : {file, file + "/below"}) {
    const auto check = Check(state, {"--listen", "insecure:127.0.0.1:0"});
    EXPECT_EQ(check->Wait(), 1);
    EXPECT_THAT(check->Log(), HasSubstr("is not a folder"));
  }
  refuses({"--listen", "insecure:127.0.0.1:99999"}, "from 0 to 65535");
  refuses({"--listen", "insecure:127.0.0.1"}, "host:port");
  refuses({"--listen", "insecure:no.such.host.invalid:7447"},
          "the host is unknown");
  refuses({"--listen", "insecure:203.0.113.1:7447"}, "cannot listen on");
  refuses({"--listen", "unix:" + std::string(200, 'x')}, "1 to 107 characters");
  refuses({"--listen", "unix:" + (folder_ / "none" / "socket").string()},
          "there is no folder");
  refuses({"--listen", "unix:" + file}, "is not a socket");
  refuses({"--listen",
           "insecure:127.0.0.1:7447",
           "--listen",
           "insecure:127.0.0.1:7447"},
          "is given twice");
  refuses({"--socket-group", "no-such-group"}, "there is no group");
  EXPECT_FALSE(std::filesystem::exists(state_));
}

TEST_F(OperationTest, CheckRefusesWhatAnotherUses) {
  const auto daemon =
      StartAndWait({"--listen",
                    "unix:" + (state_ / "selfcald.sock").string(),
                    "--listen",
                    "insecure:127.0.0.1:0"});
  const std::string log = daemon->Log();
  std::smatch port;
  ASSERT_TRUE(std::regex_search(log, port, std::regex("127.0.0.1:([0-9]+)")));
  const auto same_state = Start({"--check"});
  EXPECT_EQ(same_state->Wait(), 1);
  EXPECT_THAT(same_state->Log(), HasSubstr("in use by another selfcald"));
  const std::filesystem::path other = folder_ / "other";
  const auto same_port =
      Check(other, {"--listen", "insecure:127.0.0.1:" + port[1].str()});
  EXPECT_EQ(same_port->Wait(), 1);
  EXPECT_THAT(same_port->Log(), HasSubstr("cannot listen on"));
  const auto same_socket =
      Check(other, {"--listen", "unix:" + (state_ / "selfcald.sock").string()});
  EXPECT_EQ(same_socket->Wait(), 1);
  EXPECT_THAT(same_socket->Log(), HasSubstr("another program listens"));
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
}

TEST_F(OperationTest, CheckLooksAtTheDatabaseWithoutChangingIt) {
  {
    const auto daemon = StartAndWait();
    daemon->Signal(SIGTERM);
    EXPECT_EQ(daemon->Wait(), 0);
  }
  const std::string database = (state_ / "selfcal.db").string();
  const std::string before = ReadBytes(database);
  const auto good = Start({"--check"});
  EXPECT_EQ(good->Wait(), 0) << good->Log();
  EXPECT_EQ(ReadBytes(database), before);
  std::string later = before;
  later[63] = static_cast<char>(0x7f);  // the schema version
  WriteBytes(database, later);
  const auto newer = Start({"--check"});
  EXPECT_EQ(newer->Wait(), 1);
  EXPECT_THAT(newer->Log(), HasSubstr("has schema version 127"));
  WriteBytes(database, "something else");
  const auto foreign = Start({"--check"});
  EXPECT_EQ(foreign->Wait(), 1);
  EXPECT_THAT(foreign->Log(), HasSubstr("is not an SQLite database"));
}

TEST_F(OperationTest, UnknownSettingsAreAnsweredWithTheNearest) {
  const auto flag = Start({"--check", "--max-rig=5"});
  EXPECT_EQ(flag->Wait(), 2);
  EXPECT_THAT(flag->Log(), HasSubstr("did you mean '--max-rigs'?"));
  const auto key =
      Start({"--check", "--config", File("c.toml", "scoring-treads = 2\n")});
  EXPECT_EQ(key->Wait(), 2);
  EXPECT_THAT(key->Log(), HasSubstr("did you mean 'scoring-threads'?"));
}

TEST_F(OperationTest, NoSecretReachesTheLog) {
  Certificates certificates;
  certificates.Add("admin", "ca", "URI:selfcal://role/administer");
  certificates.AddAuthority("other");
  certificates.Add("stranger", "other", "URI:selfcal://role/administer");
  auto arguments = certificates.DaemonArguments();
  arguments.insert(arguments.end(),
                   {"--log-level", "trace", "--tls-refresh", "1"});
  const auto daemon = Start(arguments);
  const std::string address = daemon->Word("ready: listening on ");
  for (const std::string name : {"admin", "stranger", ""}) {
    const auto stub = v1::RigService::NewStub(
        grpc::CreateChannel(address, certificates.Client(name)));
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() +
                         std::chrono::seconds(20));
    v1::ListRigsResponse response;
    EXPECT_EQ(stub->ListRigs(&context, {}, &response).ok(), name == "admin");
  }
  // A key that cannot be used any more.
  std::string key = ReadBytes(certificates.Key("server"));
  std::ofstream(certificates.Key("server")) << key.substr(0, key.size() / 2);
  EXPECT_TRUE(daemon->Says("the TLS files on disk are not taken up"))
      << daemon->Log();
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
  std::istringstream lines(key);
  for (std::string line; std::getline(lines, line);) {
    if (line.find("PRIVATE KEY") != line.npos) continue;
    EXPECT_THAT(daemon->Log(), Not(HasSubstr(line.substr(0, 16))));
  }
  EXPECT_THAT(daemon->Log(), Not(HasSubstr("PRIVATE KEY")));
}

TEST_F(OperationTest, LogLevelIsTakenUpOnHangup) {
  const auto config = File("c.toml", "log-level = \"info\"\n");
  const auto daemon = StartAndWait({"--config", config});
  File("c.toml", "log-levle = \"trace\"\n");
  daemon->Signal(SIGHUP);
  EXPECT_TRUE(daemon->Says("log level: unchanged", "log-levle"))
      << daemon->Log();
  File("c.toml", "log-level = \"error\"\n");
  // If both are pending, the daemon receives SIGHUP first: it has the lower
  // number. From then on nothing at info is written, the stop included.
  daemon->Signal(SIGHUP);
  daemon->Signal(SIGTERM);
  EXPECT_EQ(daemon->Wait(), 0);
  EXPECT_THAT(daemon->Log(), Not(HasSubstr("stopped")));
}

TEST_F(OperationTest, EveryLineOfAJsonLogIsAnObject) {
  const auto daemon = Start({"--log-format", "json", "--listen", "unix:/no/x"});
  EXPECT_EQ(daemon->Wait(), 1);
  std::istringstream lines(daemon->Log());
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    const auto object = nlohmann::json::parse(line, nullptr, false);
    ASSERT_TRUE(object.is_object()) << line;
    EXPECT_TRUE(object.contains("time") && object.contains("level") &&
                object.contains("message"))
        << line;
  }
  EXPECT_GT(count, 0);
}

TEST_F(OperationTest, ServiceManagerIsToldOfStartLifeAndStop) {
  const std::string path = folder_ / "notify";
  NotifySocket manager(path);
  setenv("NOTIFY_SOCKET", path.c_str(), 1);
  setenv("WATCHDOG_USEC", "200000", 1);
  const auto daemon = Start();
  unsetenv("NOTIFY_SOCKET");
  unsetenv("WATCHDOG_USEC");
  EXPECT_TRUE(manager.Hears("STATUS=opening the database"));
  EXPECT_TRUE(manager.Hears("READY=1"));
  EXPECT_TRUE(manager.Hears("WATCHDOG=1"));
  EXPECT_TRUE(manager.Hears("WATCHDOG=1"));
  daemon->Signal(SIGTERM);
  EXPECT_TRUE(manager.Hears("STOPPING=1"));
  EXPECT_EQ(daemon->Wait(), 0);
}

// gRPC does not accept any more once it had no file for a connection: a daemon
// that is deaf ends, so that its service manager restarts it.
TEST_F(OperationTest, MoreConnectionsThanFilesEndItWithAnError) {
  const std::string shell = "ulimit -n 64; exec \"$0\" \"$@\"";
  Process daemon(
      {"/bin/bash", "-c", shell, SELFCALD_PATH, "--state-dir", state_.string()},
      folder_ / "few");
  ASSERT_TRUE(daemon.Says("selfcald ready")) << daemon.Log();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  (state_ / "selfcald.sock")
      .string()
      .copy(address.sun_path, sizeof(address.sun_path) - 1);
  std::vector<int> connections;
  for (int k = 0; k < 100; ++k) {
    connections.push_back(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    // Some are refused: there are more than it has files for.
    static_cast<void>(connect(connections.back(),
                              reinterpret_cast<sockaddr*>(&address),
                              sizeof(address)));
  }
  EXPECT_EQ(daemon.Wait(), 1);
  EXPECT_THAT(daemon.Log(), HasSubstr("to be restarted"));
  for (const int connection : connections) close(connection);
}

// A promise: SIGTERM while clients stream ends the daemon with 0, which it does
// only within 10 s, and what was acknowledged is there at the next start.
TEST_F(OperationTest, StopUnderLoadLosesNothing) {
  Promise promise("a stop loses nothing, within 10 s");
  const int trials = Trials(2);
  constexpr int kClients = 4;
  const auto segments = TestSegments(TestRig("r"), 4);
  std::set<std::string> acknowledged;
  std::mutex mutex;
  for (int trial = 0; trial < trials; ++trial, ++promise.trials) {
    auto daemon = StartAndWait();
    if (trial == 0) CreateRig();
    std::atomic<int> verdicts = 0;
    std::vector<std::thread> clients;
    for (int client = 0; client < kClients; ++client) {
      clients.emplace_back([&, client] {
        grpc::ClientContext context;
        const auto stub = v1::SegmentService::NewStub(channel_);
        const auto stream = stub->StreamSegments(&context);
        const std::string session =
            "t" + std::to_string(trial) + "c" + std::to_string(client);
        v1::StreamSegmentsRequest request;
        v1::StreamSegmentsResponse response;
        request.set_parent("rigs/r");
        for (int index = 0;; ++index) {
          MotionSegment segment = segments[index % segments.size()];
          segment.key = {session, index};
          *request.mutable_segment() = ToProto(segment);
          if (!stream->Write(request) || !stream->Read(&response)) break;
          ++verdicts;
          if (response.verdict() != v1::StreamSegmentsResponse::STORED)
            continue;
          const std::lock_guard lock(mutex);
          acknowledged.insert(session + "~" + std::to_string(index));
        }
        stream->Finish();
      });
    }
    EXPECT_TRUE(Eventually([&] { return verdicts >= 2 * kClients; }));
    const auto start = steady_clock::now();
    daemon->Signal(SIGTERM);
    const std::optional<int> code = daemon->Wait();
    const std::chrono::duration<double> taken = steady_clock::now() - start;
    const bool kept = code == 0 && taken < std::chrono::seconds(10);
    EXPECT_TRUE(kept) << "trial " << trial << ": exit code "
                      << code.value_or(-1) << " after " << taken.count()
                      << " s\n"
                      << daemon->Log();
    promise.lost += kept ? 0 : 1;
    for (std::thread& client : clients) client.join();
  }
  const auto daemon = StartAndWait();
  v1::ListSegmentsRequest request;
  request.set_parent("rigs/r");
  request.set_page_size(1000);
  std::set<std::string> found;
  do {
    grpc::ClientContext context;
    v1::ListSegmentsResponse response;
    const auto stub = v1::SegmentService::NewStub(channel_);
    ASSERT_TRUE(stub->ListSegments(&context, request, &response).ok());
    for (const auto& segment : response.segments()) {
      found.insert(segment.name().substr(segment.name().rfind('/') + 1));
    }
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  for (const std::string& name : acknowledged) {
    EXPECT_EQ(found.count(name), 1u) << name << " was acknowledged";
    promise.lost += found.count(name) == 0;
  }
  EXPECT_GE(acknowledged.size(), 2u * kClients * trials);
}

// The names of series, without what stands in labels and strings, and without
// functions and words of the language.
std::set<std::string> SeriesIn(const std::string& expression) {
  std::set<std::string> names;
  static const std::regex kSeries("\\b(selfcal|process)_[a-z_]+");
  for (std::sregex_iterator at(expression.begin(), expression.end(), kSeries),
       end;
       at != end;
       ++at) {
    names.insert(at->str());
  }
  return names;
}

std::set<std::string> LabelsIn(const std::string& expression) {
  std::set<std::string> labels;
  static const std::regex kLabel("([a-z]+=\"[a-z]+\")");
  for (std::sregex_iterator at(expression.begin(), expression.end(), kLabel),
       end;
       at != end;
       ++at) {
    labels.insert(at->str());
  }
  labels.erase("job=\"selfcal\"");  // Prometheus adds it
  return labels;
}

std::vector<std::string> DeployedExpressions() {
  std::vector<std::string> expressions;
  const std::string deploy = SELFCAL_DEPLOY "/monitoring/";
  const YAML::Node alerts = YAML::LoadFile(deploy + "alerts.yml");
  for (const auto& group : alerts["groups"]) {
    for (const auto& rule : group["rules"]) {
      EXPECT_TRUE(rule["alert"] && rule["annotations"]["summary"]);
      expressions.push_back(rule["expr"].as<std::string>());
    }
  }
  std::ifstream file(deploy + "dashboard.json");
  const auto dashboard = nlohmann::json::parse(file);
  for (const auto& panel : dashboard.at("panels")) {
    for (const auto& target : panel.at("targets")) {
      expressions.push_back(target.at("expr").get<std::string>());
    }
  }
  return expressions;
}

TEST_F(OperationTest, RequestsThatTheMetricsRefuseDoNotEndTheDaemon) {
  const auto daemon = StartAndWait({"--metrics", "127.0.0.1:0"});
  const std::string url = daemon->Word("metrics: ");
  HttpGet(url + "/other");
  HttpGet(url, "evil.example");
  HttpGet(url, "localhost\r\nContent-Length: -1");
  EXPECT_THAT(HttpGet(url), HasSubstr("selfcal_build_info"));
}

TEST_F(OperationTest, AlertsAndDashboardShowSeriesThatThereAre) {
  const Certificates certificates;
  const auto daemon = StartWithTls(
      certificates,
      {"--metrics", "127.0.0.1:0", "--uplink", "unix:/nonexistent/hub.sock"});
  const Rig rig = CreateRig();
  Stream(TestSegments(rig, 4));
  ASSERT_TRUE(AllScored());
  const std::string url = daemon->Word("metrics: ");
  // The uplink has begun.
  EXPECT_TRUE(Eventually([&] {
    return HttpGet(url).find("selfcal_uplink_waiting_records{") !=
           std::string::npos;
  }));
  const std::string series = HttpGet(url);
  EXPECT_THAT(series,
              HasSubstr("selfcal_segments_total{verdict=\"stored\"} 4"));
  EXPECT_THAT(series,
              HasSubstr("selfcal_table_entries{rig=\"r\",group=\"imu\"} 2"));
  const auto expressions = DeployedExpressions();
  EXPECT_GT(expressions.size(), 15u);
  std::set<std::string> used;
  for (const std::string& expression : expressions) {
    for (const std::string& name : SeriesIn(expression)) {
      used.insert(name);
      EXPECT_TRUE(std::regex_search(series, std::regex("\n" + name + "[{ ]")))
          << name << " of " << expression;
    }
    for (const std::string& label : LabelsIn(expression)) {
      EXPECT_THAT(series, HasSubstr(label)) << expression;
    }
  }
  EXPECT_GT(used.size(), 12u);
}

}  // namespace
}  // namespace selfcal::server
