// Streams a recording to selfcald as a SLAM process would, then waits until all
// segments are acknowledged.
//
//   stream_recording TARGET RIG DIR [SPOOL_DIR]
//
// DIR has three files with comma-separated numbers, one record per line, in the
// order of time:
//
//   imu.csv           t_ns, gyroscope x y z [rad/s],
//                     accelerometer x y z [m/s^2]
//   keyframes.csv     t_ns, q_GI w x y z, p_GI x y z [m], v_GI x y z [m/s],
//                     b_a x y z [m/s^2], b_g x y z [rad/s]
//   observations.csv  t_ns of the keyframe, camera, landmark, u v [px],
//                     p_G x y z [m] of the landmark
//
// Exit code: 0 if every segment is stored (by this or an earlier call), 1 if
// not, 2 if the recording cannot be read.
#include <selfcal/client.h>
#include <selfcal/segment_builder.h>

#include <charconv>
#include <cstdio>
#include <fstream>
#include <map>
#include <string>
#include <vector>

namespace {

namespace sc = selfcal::client;

using Row = std::vector<double>;

// Parses a time and `count` numbers; false for any other line. The time is an
// integer, because a double cannot represent its nanoseconds.
bool Parse(const std::string& line,
           std::size_t count,
           std::int64_t* t_ns,
           Row* row) {
  const char* at = line.data();
  const char* const end = at + line.size();
  auto parsed = std::from_chars(at, end, *t_ns);
  row->clear();
  while (parsed.ec == std::errc() && parsed.ptr != end) {
    if (*parsed.ptr != ',') return false;
    double value = 0;
    parsed = std::from_chars(parsed.ptr + 1, end, value);
    row->push_back(value);
  }
  return parsed.ec == std::errc() && row->size() == count;
}

// Calls back for each line of the file. On an error, prints it and returns
// false.
template <typename Callback>
bool ForEachRow(const std::string& path,
                std::size_t count,
                const Callback& callback) {
  std::ifstream file(path);
  std::string line;
  Row row;
  std::int64_t t_ns = 0;
  for (int number = 1; std::getline(file, line); ++number) {
    if (!Parse(line, count, &t_ns, &row)) {
      std::fprintf(stderr,
                   "%s:%d: not a time and %zu numbers\n",
                   path.c_str(),
                   number,
                   count);
      return false;
    }
    callback(t_ns, row);
  }
  if (file.eof()) return true;
  std::fprintf(stderr, "cannot read %s\n", path.c_str());
  return false;
}

struct Recording {
  std::vector<selfcal::ImuSample> imu;
  std::vector<selfcal::KeyframeState> keyframes;
  std::map<std::int64_t, std::vector<sc::KeyframeObservation>> observations;
};

bool Read(const std::string& dir, Recording* recording) {
  return ForEachRow(dir + "/imu.csv",
                    6,
                    [&](std::int64_t t_ns, const Row& r) {
                      recording->imu.push_back(
                          {t_ns, {r[0], r[1], r[2]}, {r[3], r[4], r[5]}});
                    }) &&
         ForEachRow(dir + "/keyframes.csv",
                    16,
                    [&](std::int64_t t_ns, const Row& r) {
                      selfcal::KeyframeState x;
                      x.t_ns = t_ns;
                      x.q_GI = Eigen::Quaterniond(r[0], r[1], r[2], r[3]);
                      x.p_GI = {r[4], r[5], r[6]};
                      x.v_GI = {r[7], r[8], r[9]};
                      x.b_a = {r[10], r[11], r[12]};
                      x.b_g = {r[13], r[14], r[15]};
                      recording->keyframes.push_back(x);
                    }) &&
         ForEachRow(dir + "/observations.csv",
                    7,
                    [&](std::int64_t t_ns, const Row& r) {
                      recording->observations[t_ns].push_back(
                          {static_cast<std::int32_t>(r[0]),
                           static_cast<std::uint64_t>(r[1]),
                           {r[2], r[3]},
                           {r[4], r[5], r[6]}});
                    });
}

void OnAck(const sc::Acknowledgement& ack) {
  for (const selfcal::Violation& v : ack.violations) {
    std::fprintf(stderr,
                 "segment %lld: %s %s\n",
                 static_cast<long long>(ack.key.index),
                 v.field.c_str(),
                 v.message.c_str());
  }
}

void OnCalibration(const sc::CalibrationVersion& active) {
  std::printf("calibration %lld is active, focal length %.2f px\n",
              static_cast<long long>(active.version),
              active.theta.cameras.front().f.x());
}

// Waits when many segments are queued, because a recording can wait; a SLAM
// system would continue.
void Send(sc::SegmentStream* stream, sc::SegmentBuilder* builder) {
  while (auto closed = builder->TakeClosed()) {
    if (stream->statistics().queued >= 8) {
      if (!stream->Drain(std::chrono::seconds(30)).ok()) return;
    }
    stream->Send(*std::move(closed));
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4 && argc != 5) {
    std::fprintf(stderr, "usage: %s TARGET RIG DIR [SPOOL_DIR]\n", argv[0]);
    return 2;
  }
  sc::ClientOptions options;
  options.target = argv[1];
  options.rig = argv[2];
  if (argc == 5) options.spool_dir = argv[4];
  Recording recording;
  if (!Read(argv[3], &recording)) return 2;

  const sc::CalibrationWatch watch(options, &OnCalibration);
  sc::SegmentStream stream(options, &OnAck);
  sc::SegmentBuilder builder({.session = "recording"});
  auto sample = recording.imu.begin();
  for (const selfcal::KeyframeState& state : recording.keyframes) {
    for (; sample != recording.imu.end() && sample->t_ns <= state.t_ns;
         ++sample) {
      builder.AddImu(*sample);
    }
    builder.AddKeyframe(state, recording.observations[state.t_ns]);
    Send(&stream, &builder);
  }
  for (; sample != recording.imu.end(); ++sample) builder.AddImu(*sample);
  builder.Flush(/*min_keyframes=*/10);
  Send(&stream, &builder);

  const absl::Status end = stream.Drain(std::chrono::seconds(30));
  const sc::StreamStatistics s = stream.statistics();
  std::printf("segments: %llu stored, %llu known already, %llu rejected\n",
              static_cast<unsigned long long>(s.stored),
              static_cast<unsigned long long>(s.duplicates),
              static_cast<unsigned long long>(s.rejected));
  if (!end.ok()) std::fprintf(stderr, "%s\n", end.ToString().c_str());
  return end.ok() && s.rejected == 0 && s.dropped == 0 ? 0 : 1;
}
