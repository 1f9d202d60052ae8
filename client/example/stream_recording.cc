// Streams a recording to selfcald as a SLAM process would, then waits until all
// segments are acknowledged.
//
//   stream_recording TARGET RIG DIR [SPOOL_DIR]
//
// recording.h describes the files in DIR.
//
// Exit code: 0 if every segment is stored (by this or an earlier call), 1 if
// not, 2 if the recording cannot be read.
#include <selfcal/client.h>
#include <selfcal/segment_builder.h>

#include <cstdio>
#include <string>

#include "recording.h"

namespace {

namespace sc = selfcal::client;

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
