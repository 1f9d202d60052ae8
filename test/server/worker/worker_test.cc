// Calibrations in a process of their own, and what becomes of that.
#include "server/worker/worker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <fstream>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/calibration/calibrate.h"
#include "server/worker/channel.h"
#include "server/worker/job.h"
#include "test/server/segment_source_of.h"
#include "test/server/test_segments.h"
#include "test/support/eventually.h"

namespace selfcal::server {
namespace {

using ::testing::HasSubstr;

const std::vector<std::string> kWorker = {SELFCAL_TEST_WORKER};

// The process that this thread has started; 0 for none.
pid_t Child() {
  std::ifstream file("/proc/thread-self/children");
  pid_t child = 0;
  file >> child;
  return child;
}

bool IsAlive(pid_t process) {
  std::ifstream file("/proc/" + std::to_string(process) + "/stat");
  std::string number;
  std::string name;
  char state = 'X';
  file >> number >> name >> state;
  return file.good() && state != 'Z' && state != 'X';
}

class WorkerTest : public ::testing::Test {
 protected:
  WorkerTest() { limits_.idle = false; }  // the machine may be busy

  CalibrationResult InWorker(
      const std::vector<std::string>& command = kWorker,
      const std::function<bool()>& interrupted = nullptr) {
    return InWorkerFrom(SourceOf(segments_), command, interrupted).value();
  }
  absl::StatusOr<CalibrationResult> InWorkerFrom(
      const SegmentSource& segments,
      const std::vector<std::string>& command = kWorker,
      const std::function<bool()>& interrupted = nullptr) {
    return CalibrateInWorker(command,
                             limits_,
                             rig_,
                             rig_.factory,
                             segments,
                             options_,
                             progress_,
                             interrupted);
  }

  const Rig rig_ = TestRig("a");
  const std::vector<MotionSegment> segments_ = TestSegments(rig_, 3);
  CalibrateOptions options_;
  WorkerLimits limits_;
  ProgressCallback progress_ = [](const CalibrateProgress&) { return true; };
};

TEST_F(WorkerTest, ResultAndProgressAreThoseOfCalibrateToTheBit) {
  std::vector<std::string> here;
  std::vector<std::string> there;
  const auto note = [](std::vector<std::string>* noted) {
    return [noted](const CalibrateProgress& progress) {
      noted->push_back(EncodeProgress(progress));
      return true;
    };
  };
  options_.prior = FactoryPrior(rig_);
  const CalibrationResult expected =
      Calibrate(rig_, rig_.factory, segments_, options_, note(&here));
  progress_ = note(&there);
  const CalibrationResult result = InWorker();
  ASSERT_EQ(result.status, CalibrateStatus::kConverged) << result.message;
  EXPECT_EQ(EncodeResult(result), EncodeResult(expected));
  EXPECT_EQ(BoxMinus(result.theta, expected.theta).norm(), 0);
  EXPECT_EQ(result.covariance, expected.covariance);
  EXPECT_EQ(result.Lambda, expected.Lambda);
  EXPECT_EQ(result.covariance_of_data, expected.covariance_of_data);
  EXPECT_EQ(result.rank, expected.rank);
  EXPECT_EQ(result.final_cost, expected.final_cost);
  EXPECT_EQ(result.track_noise_factor, expected.track_noise_factor);
  EXPECT_EQ(result.noise_scales.size(), expected.noise_scales.size());
  EXPECT_GT(here.size(), 2u);
  EXPECT_EQ(there, here);
}

// Whatever this estimator leaves empty.
TEST_F(WorkerTest, AStalledResultComesBackWithItsFits) {
  CalibrationResult result;
  result.status = CalibrateStatus::kStalled;
  result.theta = rig_.factory;
  const int size = TangentSize(rig_.factory);
  result.covariance = Eigen::MatrixXd::Identity(size, size);
  result.Lambda = result.covariance;
  result.covariance_of_data = 2 * result.covariance;
  result.noise_scales = {{NoiseKind::kGyro, 3, 0.05, 100, 2.9, false}};
  result.segment_fits = {{{"s", 7}, 1.5, 893, {40, 25, 0.03}, "a spike"}};
  result.halves = {30, 26, 0.25};
  result.remembered = {9, 1, 2, 11, 0.75, {20, 24, 0.7}, "not at all"};
  result.remembered.newest = {"s", 6};
  result.remembered.change_probability = 0.125;
  result.remembered.change_sigmas = Eigen::VectorXd::LinSpaced(size, 0, 1);
  const auto decoded = DecodeResult(EncodeResult(result));
  ASSERT_TRUE(decoded.has_value());
  EXPECT_EQ(decoded->status, CalibrateStatus::kStalled);
  EXPECT_EQ(decoded->covariance_of_data, result.covariance_of_data);
  ASSERT_EQ(decoded->noise_scales.size(), 1u);
  EXPECT_EQ(decoded->noise_scales[0].used, 2.9);
  EXPECT_FALSE(decoded->noise_scales[0].converged);
  ASSERT_EQ(decoded->segment_fits.size(), 1u);
  EXPECT_EQ(decoded->segment_fits[0].key, (SegmentKey{"s", 7}));
  EXPECT_EQ(decoded->segment_fits[0].inertial_ratio, 893);
  EXPECT_EQ(decoded->segment_fits[0].others.degrees, 25);
  EXPECT_EQ(decoded->segment_fits[0].excluded, "a spike");
  EXPECT_EQ(decoded->halves.probability, 0.25);
  EXPECT_EQ(decoded->remembered.segments, 9);
  EXPECT_EQ(decoded->remembered.newest, (SegmentKey{"s", 6}));
  EXPECT_EQ(decoded->remembered.too_far, 1);
  EXPECT_EQ(decoded->remembered.contradicting, 2);
  EXPECT_EQ(decoded->remembered.compared, 11);
  EXPECT_EQ(decoded->remembered.reach, 0.75);
  EXPECT_EQ(decoded->remembered.agreement.degrees, 24);
  EXPECT_EQ(decoded->remembered.unused, "not at all");
  EXPECT_EQ(decoded->remembered.change_probability, 0.125);
  EXPECT_EQ(decoded->remembered.change_sigmas, result.remembered.change_sigmas);
}

// As many cameras as a rig may have.
TEST_F(WorkerTest, ProgressOfTheLargestRigIsOnePacket) {
  CalibrateProgress progress{7, 100, 0.1, 0.3, rig_.factory};
  progress.theta.cameras.resize(kMaxCameras, rig_.factory.cameras[0]);
  const int size = TangentSize(progress.theta);
  progress.moved = Eigen::VectorXd::LinSpaced(size, -0.1, 0.7);
  progress.sigmas = Eigen::VectorXd::LinSpaced(size, 0.01, 0.3);
  const std::string bytes = EncodeProgress(progress);
  EXPECT_LT(bytes.size(), kMaxProgressBytes);
  const auto told = DecodeProgress(bytes);
  ASSERT_TRUE(told.has_value());
  EXPECT_EQ(told->iteration, 7);
  EXPECT_EQ(told->max_iterations, 100);
  EXPECT_EQ(told->cost, 0.1);
  EXPECT_EQ(told->step_sigmas, 0.3);
  EXPECT_EQ(BoxMinus(told->theta, progress.theta).norm(), 0);
  EXPECT_EQ(told->moved, progress.moved);
  EXPECT_EQ(told->sigmas, progress.sigmas);
  progress.sigmas.conservativeResize(size - 1);
  EXPECT_FALSE(DecodeProgress(EncodeProgress(progress)).has_value());
}

TEST_F(WorkerTest, AllOfAJobArrives) {
  options_.loss = LossKind::kCauchy;
  options_.loss_scale = 1.25;
  options_.prior = FactoryPrior(rig_);
  options_.max_iterations = 7;
  options_.correlated_tracks = false;
  options_.noise_scales = false;
  options_.reweight_noise = true;
  options_.merge_landmarks = 3;
  options_.exclude_contradictions = false;
  options_.solver = SolverKind::kCeres;
  options_.threads = 2;
  options_.remembered = {
      {.key = {"s", 3}, .fit = 1.25, .time_ns = 77},
      {.key = {"s", 4},
       .ends = SummariseEnds(rig_, rig_.factory, segments_[0])}};
  options_.changing = {"camera"};
  options_.walk =
      Eigen::VectorXd::LinSpaced(TangentSize(rig_.factory), 0.1, 0.2);
  limits_ = {.idle = true, .max_memory_bytes = 123};
  const std::string bytes = EncodeJob({rig_, rig_.factory, options_, limits_});
  const auto job = DecodeJob(bytes);
  ASSERT_TRUE(job.has_value());
  EXPECT_EQ(EncodeJob(*job), bytes);
  EXPECT_EQ(job->options.loss, LossKind::kCauchy);
  EXPECT_EQ(job->options.loss_scale, 1.25);
  EXPECT_EQ(job->options.prior->information, options_.prior->information);
  EXPECT_EQ(job->options.max_iterations, 7);
  EXPECT_FALSE(job->options.correlated_tracks);
  EXPECT_FALSE(job->options.noise_scales);
  EXPECT_TRUE(job->options.reweight_noise);
  EXPECT_EQ(job->options.merge_landmarks, 3);
  EXPECT_FALSE(job->options.exclude_contradictions);
  EXPECT_EQ(job->options.solver, SolverKind::kCeres);
  EXPECT_EQ(job->options.threads, 2);
  ASSERT_EQ(job->options.remembered.size(), 2u);
  EXPECT_EQ(job->options.remembered[0].key, (SegmentKey{"s", 3}));
  EXPECT_FALSE(job->options.remembered[0].ends);
  EXPECT_EQ(job->options.remembered[0].fit, 1.25);
  EXPECT_EQ(job->options.remembered[0].time_ns, 77);
  EXPECT_EQ(job->options.remembered[1].ends->Lambda,
            options_.remembered[1].ends->Lambda);
  EXPECT_EQ(job->options.walk, options_.walk);
  EXPECT_EQ(job->options.changing, options_.changing);
  EXPECT_TRUE(job->limits.idle);
  EXPECT_EQ(job->limits.max_memory_bytes, 123);
  EXPECT_FALSE(job->scorer);
  EXPECT_FALSE(DecodeJob("not a job").has_value());
  const std::string segment = EncodeSegment(segments_[0]);
  EXPECT_EQ(EncodeSegment(DecodeSegment(segment).value()), segment);
  EXPECT_FALSE(DecodeSegment("not a segment").has_value());
}

TEST_F(WorkerTest, AnErrorOfTheSegmentsEndsIt) {
  pid_t child = 0;
  int read = 0;
  const auto result =
      InWorkerFrom([&]() -> absl::StatusOr<std::optional<MotionSegment>> {
        if (++read == 3) {
          child = Child();
          return absl::DataLossError("the disk");
        }
        return segments_[0];
      });
  EXPECT_EQ(result.status(), absl::DataLossError("the disk"));
  EXPECT_EQ(read, 3);
  ASSERT_NE(child, 0);
  EXPECT_TRUE(Eventually([&] { return !IsAlive(child); }));
}

// It stops to read before it has all of them, and its message still arrives.
TEST_F(WorkerTest, SegmentsCountForItsMemory) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "it ends the process where memory runs out";
#endif
  limits_.max_memory_bytes = 8 << 20;
  constexpr int kMost = 10'000;  // some hundred megabytes
  int read = 0;
  const auto result =
      InWorkerFrom([&]() -> absl::StatusOr<std::optional<MotionSegment>> {
        if (++read > kMost) return std::nullopt;
        return segments_[0];
      });
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->status, CalibrateStatus::kFailed);
  EXPECT_THAT(result->message, HasSubstr("memory limit of a run of 8 MiB"));
  EXPECT_LT(read, kMost);
}

// One that never reads its job.
TEST_F(WorkerTest, AnInterruptionEndsTheSendingOfAJob) {
  const auto begin = std::chrono::steady_clock::now();
  const auto result = InWorkerFrom(
      [&]() -> absl::StatusOr<std::optional<MotionSegment>> {
        return segments_[0];  // without an end
      },
      {"/bin/sleep", "100000"},
      [&] {
        return std::chrono::steady_clock::now() - begin >
               std::chrono::milliseconds(300);
      });
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->status, CalibrateStatus::kCancelled);
}

TEST_F(WorkerTest, AScoreIsThatOfItsScorerToTheBit) {
  for (const ScorerKind scorer :
       {ScorerKind::kStructured, ScorerKind::kCeres}) {
    const auto score = ScoreInWorker(
        kWorker, limits_, scorer, rig_, rig_.factory, segments_[1], nullptr);
    ASSERT_TRUE(score.ok()) << score.status();
    EXPECT_EQ(
        EncodeScore(*score),
        EncodeScore(ScoreSegmentBy(scorer, rig_, rig_.factory, segments_[1])));
  }
}

TEST_F(WorkerTest, AScoreThatIsNotComputedSaysWhy) {
  const auto by = [&](const std::vector<std::string>& command,
                      const std::function<bool()>& interrupted) {
    return ScoreInWorker(command,
                         limits_,
                         ScorerKind::kCeres,
                         rig_,
                         rig_.factory,
                         segments_[0],
                         interrupted)
        .status();
  };
  EXPECT_TRUE(
      absl::IsCancelled(by({"/bin/sleep", "100000"}, [] { return true; })));
  EXPECT_THAT(std::string(by({"/bin/sh", "-c", "exit 3"}, nullptr).message()),
              HasSubstr("exit code 3"));
}

// A worker that says nothing for hours.
TEST_F(WorkerTest, AnInterruptedOneIsKilledWhereverItIs) {
  pid_t child = 0;
  const CalibrationResult result = InWorker({"/bin/sleep", "100000"}, [&] {
    child = Child();
    return child != 0;
  });
  EXPECT_EQ(result.status, CalibrateStatus::kCancelled);
  ASSERT_NE(child, 0);
  EXPECT_FALSE(IsAlive(child));
}

TEST_F(WorkerTest, ProgressThatIsNotWantedEndsIt) {
  progress_ = [](const CalibrateProgress&) { return false; };
  EXPECT_EQ(InWorker().status, CalibrateStatus::kCancelled);
  EXPECT_TRUE(Eventually([] { return Child() == 0; }));
}

TEST_F(WorkerTest, OneThatEndsBadlyFailsWithAMessage) {
  const auto message = [&](const char* script) {
    const CalibrationResult result = InWorker({"/bin/sh", "-c", script});
    EXPECT_EQ(result.status, CalibrateStatus::kFailed);
    return result.message;
  };
  EXPECT_THAT(message("kill -SEGV $$"), HasSubstr("signal 11"));
  EXPECT_THAT(message("exit 3"), HasSubstr("exit code 3"));
  EXPECT_THAT(message("exit 0"), HasSubstr("without a result"));
  EXPECT_THROW(InWorker({"/nowhere"}), std::system_error);
}

TEST_F(WorkerTest, OneThatNeedsTooMuchMemoryFailsAndSaysSo) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "it ends the process where memory runs out";
#endif
  limits_.max_memory_bytes = 1 << 20;
  const CalibrationResult result = InWorker();
  EXPECT_EQ(result.status, CalibrateStatus::kFailed);
  EXPECT_THAT(result.message, HasSubstr("memory limit of a run of 1 MiB"));
}

TEST_F(WorkerTest, AnIdleOneTakesOnlyWhatOthersLeave) {
  struct Seen {
    int policy = -1;
    long io_class = -1;
    int niceness = -1;
  };
  const auto see = [&](bool idle) {
    limits_.idle = idle;
    Seen seen;
    progress_ = [&](const CalibrateProgress&) {
      const pid_t child = Child();
      seen = {sched_getscheduler(child),
              syscall(SYS_ioprio_get, 1, child) >> 13,
              getpriority(PRIO_PROCESS, child)};
      return false;
    };
    InWorker();
    return seen;
  };
  const Seen idle = see(true);
  EXPECT_EQ(idle.policy, SCHED_IDLE);
  EXPECT_EQ(idle.io_class, 3);
  const Seen low = see(false);
  EXPECT_EQ(low.policy, SCHED_OTHER);
  EXPECT_EQ(low.niceness, 10);
  EXPECT_NE(sched_getscheduler(0), SCHED_IDLE);
}

// As the service manager and a terminal do to all processes of a service.
TEST_F(WorkerTest, SignalsToTheWholeGroupAreNotForIt) {
  progress_ = [](const CalibrateProgress&) {
    for (const int stop : {SIGTERM, SIGINT, SIGHUP}) kill(Child(), stop);
    return true;
  };
  EXPECT_EQ(InWorker().status, CalibrateStatus::kConverged);
}

TEST_F(WorkerTest, ItDiesWithTheDaemon) {
  std::array<int, 2> told{};
  ASSERT_EQ(pipe(told.data()), 0);
  const pid_t daemon = fork();
  ASSERT_GE(daemon, 0);
  if (daemon == 0) {
    progress_ = [&](const CalibrateProgress&) -> bool {
      const pid_t child = Child();
      if (write(told[1], &child, sizeof(child)) < 0) _exit(1);
      for (;;) pause();
    };
    InWorker();
    _exit(0);
  }
  pid_t worker = 0;
  ASSERT_EQ(read(told[0], &worker, sizeof(worker)), ssize_t{sizeof(worker)});
  ASSERT_TRUE(IsAlive(worker));
  kill(daemon, SIGKILL);
  waitpid(daemon, nullptr, 0);
  EXPECT_TRUE(Eventually([&] { return !IsAlive(worker); }));
  close(told[0]);
  close(told[1]);
}

}  // namespace
}  // namespace selfcal::server
