#include <chrono>
#include <memory>

#include "proto/resource_names.h"
#include "test/server/console/console_test.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

class StreamTest : public ConsoleTest {
 protected:
  std::unique_ptr<Wire> OpenStream(const std::string& path = "changes:watch") {
    auto wire = std::make_unique<Wire>(port());
    wire->Send("GET /api/v1/" + path +
               " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
    return wire;
  }

  // The first answer that lets a stream run, or the last before the time.
  std::unique_ptr<Wire> OpenStreamWithin(std::chrono::seconds time) {
    const auto end = std::chrono::steady_clock::now() + time;
    for (;;) {
      auto wire = OpenStream();
      const std::string answer = wire->ReadUntil("\r\n\r\n");
      if (answer.starts_with("HTTP/1.1 200") ||
          std::chrono::steady_clock::now() > end) {
        wire->ReadUntil("EVERYTHING");
        return wire;
      }
    }
  }
};

TEST_F(StreamTest, TellsWhatThePipelineDoes) {
  AddRig("a");
  const auto wire = OpenStream("rigs/a/changes:watch");
  EXPECT_THAT(wire->ReadUntil("EVERYTHING"), HasSubstr("text/event-stream"));
  feed_.OnVerdict("b", PipelineObserver::Verdict::kStored);
  feed_.OnVerdict("a", PipelineObserver::Verdict::kRejected);
  feed_.OnVerdict("a", PipelineObserver::Verdict::kStored);
  const std::string told = wire->ReadUntil("SEGMENTS");
  EXPECT_THAT(told, HasSubstr(R"(data: {"what":"SEGMENTS","rig":"rigs/a"})"));
  EXPECT_EQ(told.find("rigs/b"), told.npos);
  StoredRun run;
  run.rig = "a";
  feed_.OnRun(run);
  EXPECT_THAT(wire->ReadUntil("RUNS"), HasSubstr(R"("what":"RUNS")"));
}

TEST_F(StreamTest, TellsWhatIsWrittenIntoTheLogOfEvents) {
  AddRig("a");
  const auto wire = OpenStream();
  wire->ReadUntil("EVERYTHING");
  AddRig("b");
  EXPECT_THAT(wire->ReadUntil("rigs/b"), HasSubstr(R"("what":"EVENTS")"));
}

TEST_F(StreamTest, RunIsToldUntilItsEnd) {
  AddVersion(AddRig("a"));
  const auto run = domain_->CreateManualRun("a", true);
  ASSERT_TRUE(run.ok()) << run.status();
  const auto wire = OpenStream("rigs/a/recalibrations/2:watch");
  EXPECT_THAT(wire->ReadUntil("PENDING"), HasSubstr("data: {"));
  RunUpdate update{*run, {}};
  update.run.state = RunState::kRunning;
  update.progress.iteration = 3;
  update.progress.cost = 12.5;
  pipeline_->Tell(update);
  EXPECT_THAT(wire->ReadUntil("\"cost\":12.5"), HasSubstr("\"iteration\":3"));
  update.run.state = RunState::kSucceeded;
  pipeline_->Tell(update);
  EXPECT_THAT(wire->ReadUntil(""), HasSubstr("SUCCEEDED"));
  EXPECT_TRUE(Eventually([&] { return pipeline_->watchers() == 0; }));
}

TEST_F(StreamTest, RunIsToldFromItsFirstIteration) {
  const Rig rig = AddRig("a");
  AddVersion(rig);
  const auto run = domain_->CreateManualRun("a", true);
  ASSERT_TRUE(run.ok()) << run.status();
  const auto wire = OpenStream("rigs/a/recalibrations/2:watch");
  wire->ReadUntil("PENDING");
  RunUpdate update{*run};
  update.progress.iteration = 3;
  update.progress.theta = rig.factory;
  update.progress.theta.imu.s_g.x() = 1.5;
  const auto size = TangentSize(rig.factory);
  update.progress.moved = Eigen::VectorXd::Constant(size, 0.5);
  update.progress.sigmas = Eigen::VectorXd::Zero(size);
  update.progress.sigmas[0] = 0.25;
  update.missed = {update.progress, update.progress};
  update.missed[0].iteration = 1;
  update.missed[1].iteration = 2;
  pipeline_->Tell(update);
  const std::string told = wire->ReadUntil("\"iteration\":3");
  const auto first = told.find("\"iteration\":1");
  const auto second = told.find("\"iteration\":2");
  ASSERT_NE(first, told.npos);
  ASSERT_NE(second, told.npos);
  EXPECT_LT(first, second);
  EXPECT_LT(second, told.find("\"iteration\":3"));
  // What is held fixed is not among them.
  EXPECT_THAT(
      told,
      HasSubstr(R"("parameters":[{"component":"imu.gyro.scale.x",)"
                R"("unit":"-","value":1.5,"moved":0.5,"sigma":0.25}])"));
}

TEST_F(StreamTest, StreamsOfADeletedRigEndWithAnError) {
  AddRig("a");
  Open(Role::kAdminister);
  const auto changes = OpenStream("rigs/a/changes:watch");
  changes->ReadUntil("EVERYTHING");
  const auto versions = OpenStream("rigs/a/calibrations:watch");
  versions->ReadUntil("data: {");
  const Reply deleted = Exchange(
      "DELETE /api/v1/rigs/a?reason=sold HTTP/1.1\r\nHost: localhost\r\n"
      "Connection: close\r\nX-Selfcal-Console: 1\r\n\r\n");
  ASSERT_EQ(deleted.status, 200) << deleted.body;
  for (Wire* wire : {changes.get(), versions.get()}) {
    const std::string rest = wire->ReadUntil("");
    EXPECT_THAT(rest, HasSubstr("event: error"));
    EXPECT_THAT(rest, HasSubstr("NOT_FOUND"));
    EXPECT_THAT(rest, HasSubstr("deleted"));
  }
}

TEST_F(StreamTest, StreamsAreBounded) {
  std::vector<std::unique_ptr<Wire>> open;
  for (int i = 0; i < 16; ++i) {
    open.push_back(OpenStream());
    EXPECT_THAT(open.back()->ReadUntil("EVERYTHING"), HasSubstr("200 OK"));
  }
  EXPECT_EQ(Get("/api/v1/changes:watch").status, 503);
  EXPECT_EQ(Get("/api/v1/rigs").status, 200);
}

TEST_F(StreamTest, ReadersThatHaveGoneMakeRoom) {
  for (int round = 0; round < 5; ++round) {
    std::vector<std::unique_ptr<Wire>> open;
    for (int i = 0; i < 16; ++i) {
      // Sooner than two heartbeats, the first of which a dead socket takes.
      open.push_back(OpenStreamWithin(std::chrono::seconds(4)));
      ASSERT_THAT(open.back()->ReadUntil("EVERYTHING"), HasSubstr("200 OK"));
    }
  }
}

TEST_F(StreamTest, ConsoleEndsWithStreamsOpen) {
  AddRig("a");
  const auto wire = OpenStream();
  wire->ReadUntil("EVERYTHING");
  console_.reset();
  EXPECT_THAT(wire->ReadUntil(""), HasSubstr("EVERYTHING"));
}

}  // namespace
}  // namespace selfcal::server
