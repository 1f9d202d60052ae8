// The same as stream_recording.cc, in C++11: streams a recording to selfcald as
// a SLAM process would, then waits until all segments are acknowledged.
//
//   stream_recording_cxx11 TARGET RIG DIR [SPOOL_DIR]
//
// recording.h describes the files in DIR, stream_recording.cc the exit code.
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <map>
#include <selfcal/selfcal.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace {

// A time and the numbers after it.
struct Row {
  std::int64_t t_ns;
  std::vector<double> numbers;
};

// Throws std::invalid_argument for a line that is no time and `count` numbers.
Row Parse(const std::string& line, std::size_t count) {
  std::istringstream fields(line);
  std::string field;
  Row row;
  std::getline(fields, field, ',');
  row.t_ns = std::stoll(field);
  while (std::getline(fields, field, ',')) {
    row.numbers.push_back(std::stod(field));
  }
  if (row.numbers.size() != count) throw std::invalid_argument(line);
  return row;
}

// Throws std::runtime_error if the file cannot be read.
std::vector<Row> Read(const std::string& path, std::size_t count) {
  std::ifstream file(path);
  std::vector<Row> rows;
  std::string line;
  try {
    while (std::getline(file, line)) rows.push_back(Parse(line, count));
  } catch (const std::logic_error&) {
    throw std::runtime_error(path + ": cannot read '" + line + "'");
  }
  if (!file.eof()) throw std::runtime_error("cannot read " + path);
  return rows;
}

selfcal::ImuSample ToSample(const Row& row) {
  selfcal::ImuSample sample;
  sample.t_ns = row.t_ns;
  std::copy_n(row.numbers.begin(), 3, sample.gyro);
  std::copy_n(row.numbers.begin() + 3, 3, sample.accel);
  return sample;
}

selfcal::KeyframeState ToState(const Row& row) {
  const std::vector<double>& x = row.numbers;
  selfcal::KeyframeState state;
  state.t_ns = row.t_ns;
  state.q_GI = selfcal::Quaternion{x[0], x[1], x[2], x[3]};  // w, x, y, z
  std::copy_n(x.begin() + 4, 3, state.p_GI);
  std::copy_n(x.begin() + 7, 3, state.v_GI);
  std::copy_n(x.begin() + 10, 3, state.b_a);
  std::copy_n(x.begin() + 13, 3, state.b_g);
  return state;
}

selfcal::Observation ToObservation(const Row& row) {
  selfcal::Observation seen = selfcal::Observation();
  seen.camera = static_cast<std::int32_t>(row.numbers[0]);
  seen.landmark_id = static_cast<std::uint64_t>(row.numbers[1]);
  std::copy_n(row.numbers.begin() + 2, 2, seen.z_px);
  std::copy_n(row.numbers.begin() + 4, 3, seen.p_G);
  return seen;
}

void OnAck(const selfcal::Acknowledgement& ack) {
  for (const selfcal::Violation& v : ack.violations) {
    std::fprintf(stderr,
                 "segment %lld: %s %s\n",
                 static_cast<long long>(ack.index),
                 v.field.c_str(),
                 v.message.c_str());
  }
}

void OnCalibration(const selfcal::Calibration& active) {
  std::printf("calibration %lld is active, focal length %.2f px\n",
              static_cast<long long>(active.version()),
              active.camera(0).f[0]);
}

// Waits when many segments are queued, because a recording can wait; a SLAM
// system would continue.
void SendComplete(selfcal::Builder* builder, selfcal::Stream* stream) {
  while (selfcal::Segment segment = builder->Take()) {
    if (stream->statistics().queued >= 8) {
      if (!stream->Drain(std::chrono::seconds(30)).ok()) return;
    }
    stream->Send(std::move(segment));
  }
}

void StreamAll(const std::string& dir, selfcal::Stream* stream) {
  std::map<std::int64_t, std::vector<selfcal::Observation>> observations;
  for (const Row& row : Read(dir + "/observations.csv", 7)) {
    observations[row.t_ns].push_back(ToObservation(row));
  }
  const std::vector<Row> imu = Read(dir + "/imu.csv", 6);
  selfcal::BuilderOptions session;
  session.session = "recording";
  selfcal::Builder builder(session);
  auto sample = imu.begin();
  for (const Row& keyframe : Read(dir + "/keyframes.csv", 16)) {
    for (; sample != imu.end() && sample->t_ns <= keyframe.t_ns; ++sample) {
      builder.AddImu(ToSample(*sample));
    }
    builder.AddKeyframe(ToState(keyframe), observations[keyframe.t_ns]);
    SendComplete(&builder, stream);
  }
  for (; sample != imu.end(); ++sample) builder.AddImu(ToSample(*sample));
  builder.Flush(/*min_keyframes=*/10);
  SendComplete(&builder, stream);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4 && argc != 5) {
    std::fprintf(stderr, "usage: %s TARGET RIG DIR [SPOOL_DIR]\n", argv[0]);
    return 2;
  }
  selfcal::ClientOptions options;
  options.target = argv[1];
  options.rig = argv[2];
  if (argc == 5) options.spool_dir = argv[4];
  try {
    const selfcal::Watch watch(options, &OnCalibration);
    selfcal::Stream stream(options, &OnAck);
    StreamAll(argv[3], &stream);
    const selfcal::Status end = stream.Drain(std::chrono::seconds(30));
    const selfcal_stream_statistics s = stream.statistics();
    std::printf("segments: %llu stored, %llu known already, %llu rejected\n",
                static_cast<unsigned long long>(s.stored),
                static_cast<unsigned long long>(s.duplicates),
                static_cast<unsigned long long>(s.rejected));
    if (!end.ok()) std::fprintf(stderr, "%s\n", end.message().c_str());
    return end.ok() && s.rejected == 0 && s.dropped == 0 ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
