// The same as stream_recording.cc, in C99: streams a recording to selfcald as a
// SLAM process would, then waits until all segments are acknowledged.
//
//   stream_recording_c TARGET RIG DIR [SPOOL_DIR]
//
// recording.h describes the files in DIR, stream_recording.cc the exit code.
#include <inttypes.h>
#include <selfcal/selfcal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAX_NUMBERS 16
#define MAX_OBSERVATIONS 20000

static void print_error(const char* what, const selfcal_error* error) {
  fprintf(
      stderr, "%s: error %" PRId32 ": %s\n", what, error->code, error->message);
}

static void on_ack(const selfcal_acknowledgement* ack, void* user) {
  (void)user;
  for (uint64_t i = 0; i < ack->violation_count; ++i) {
    fprintf(stderr,
            "segment %" PRId64 ": %s %s\n",
            ack->index,
            ack->violations[i].field,
            ack->violations[i].message);
  }
}

static void on_calibration(const selfcal_calibration* calibration, void* user) {
  selfcal_camera camera = SELFCAL_INIT(selfcal_camera);
  selfcal_error error;
  (void)user;
  if (selfcal_calibration_get_camera(calibration, 0, &camera, &error) != 0) {
    print_error("calibration", &error);
    return;
  }
  printf("calibration %" PRId64 " is active, focal length %.2f px\n",
         selfcal_calibration_version(calibration),
         camera.f[0]);
}

// Reads a time and `count` numbers from the next line. Returns 1, 0 at the end
// of the file, -1 for a line that is something else.
static int read_row(FILE* file, int count, int64_t* t_ns, double* row) {
  char line[1024];
  if (fgets(line, sizeof(line), file) == NULL) return feof(file) ? 0 : -1;
  char* at = line;
  *t_ns = strtoll(line, &at, 10);
  if (at == line) return -1;
  for (int i = 0; i < count; ++i) {
    if (*at != ',') return -1;
    char* const number = at + 1;
    row[i] = strtod(number, &at);
    if (at == number) return -1;
  }
  return *at == '\n' || *at == '\0' ? 1 : -1;
}

// A file of the recording, with the row that was read last.
typedef struct {
  FILE* file;
  int count;  // numbers in a row, besides the time
  int state;  // of the row: 1, 0 at the end, -1 after an error
  int64_t t_ns;
  double row[MAX_NUMBERS];
} rows;

static void next(rows* r) {
  r->state = read_row(r->file, r->count, &r->t_ns, r->row);
}

static int open_rows(const char* dir, const char* name, int count, rows* r) {
  char path[4096];
  snprintf(path, sizeof(path), "%s/%s", dir, name);
  r->count = count;
  r->file = fopen(path, "r");
  if (r->file == NULL) {
    fprintf(stderr, "cannot read %s\n", path);
    return 0;
  }
  next(r);
  return 1;
}

static int add_imu(selfcal_builder* builder, const rows* r) {
  selfcal_imu_sample sample;
  selfcal_error error;
  sample.t_ns = r->t_ns;
  memcpy(sample.gyro, r->row, sizeof(sample.gyro));
  memcpy(sample.accel, r->row + 3, sizeof(sample.accel));
  if (selfcal_builder_add_imu(builder, &sample, &error) == 0) return 1;
  print_error("IMU sample", &error);
  return 0;
}

// Adds the keyframe, with all observations at its time.
static int add_keyframe(selfcal_builder* builder,
                        const rows* keyframe,
                        rows* observations,
                        selfcal_observation* seen) {
  const double* const x = keyframe->row;
  uint64_t count = 0;
  selfcal_keyframe_state state;
  selfcal_error error;
  state.t_ns = keyframe->t_ns;
  state.q_GI.w = x[0];
  state.q_GI.x = x[1];
  state.q_GI.y = x[2];
  state.q_GI.z = x[3];
  memcpy(state.p_GI, x + 4, sizeof(state.p_GI));
  memcpy(state.v_GI, x + 7, sizeof(state.v_GI));
  memcpy(state.b_a, x + 10, sizeof(state.b_a));
  memcpy(state.b_g, x + 13, sizeof(state.b_g));
  for (; observations->state == 1 && observations->t_ns == keyframe->t_ns;
       next(observations)) {
    const double* const z = observations->row;
    if (count == MAX_OBSERVATIONS) break;
    seen[count].camera = (int32_t)z[0];
    seen[count].landmark_id = (uint64_t)z[1];
    seen[count].reserved = 0;
    memcpy(seen[count].z_px, z + 2, sizeof(seen[count].z_px));
    memcpy(seen[count].p_G, z + 4, sizeof(seen[count].p_G));
    ++count;
  }
  if (selfcal_builder_add_keyframe(builder, &state, seen, count, &error) == 0) {
    return 1;
  }
  print_error("keyframe", &error);
  return 0;
}

// Waits when many segments are queued, because a recording can wait; a SLAM
// system would continue.
static void send_complete(selfcal_builder* builder, selfcal_stream* stream) {
  selfcal_segment* segment;
  selfcal_error error;
  while ((segment = selfcal_builder_take(builder)) != NULL) {
    selfcal_stream_statistics s = SELFCAL_INIT(selfcal_stream_statistics);
    selfcal_stream_get_statistics(stream, &s, NULL);
    if (s.queued >= 8) selfcal_stream_drain(stream, 30000, NULL);
    if (selfcal_stream_send(stream, segment, &error) != 0) {
      print_error("segment", &error);
    }
  }
}

// Returns 0 if a file of the recording has a line that cannot be read.
static int stream_all(rows* imu,
                      rows* keyframes,
                      rows* observations,
                      selfcal_builder* builder,
                      selfcal_stream* stream) {
  selfcal_observation* const seen = malloc(MAX_OBSERVATIONS * sizeof(*seen));
  if (seen == NULL) return 0;
  for (; keyframes->state == 1; next(keyframes)) {
    for (; imu->state == 1 && imu->t_ns <= keyframes->t_ns; next(imu)) {
      add_imu(builder, imu);
    }
    add_keyframe(builder, keyframes, observations, seen);
    send_complete(builder, stream);
  }
  free(seen);
  for (; imu->state == 1; next(imu)) add_imu(builder, imu);
  selfcal_builder_flush(builder, 10, NULL);
  send_complete(builder, stream);
  return imu->state == 0 && keyframes->state == 0 && observations->state == 0;
}

// Returns the exit code.
static int run(const selfcal_client_options* options,
               rows* imu,
               rows* keyframes,
               rows* observations) {
  selfcal_builder_options session = SELFCAL_INIT(selfcal_builder_options);
  selfcal_stream_statistics s = SELFCAL_INIT(selfcal_stream_statistics);
  selfcal_builder* builder = NULL;
  selfcal_stream* stream = NULL;
  selfcal_watch* watch = NULL;
  selfcal_error error;
  int code = 1;
  session.session = "recording";
  if (selfcal_builder_create(&session, &builder, &error) != 0 ||
      selfcal_stream_create(options, on_ack, NULL, &stream, &error) != 0 ||
      selfcal_watch_create(options, on_calibration, NULL, &watch, &error) !=
          0) {
    print_error("client", &error);
  } else if (!stream_all(imu, keyframes, observations, builder, stream)) {
    fprintf(stderr, "the recording cannot be read\n");
    code = 2;
  } else {
    if (selfcal_stream_drain(stream, 30000, &error) == 0) code = 0;
    if (code != 0) print_error("stream", &error);
    selfcal_stream_get_statistics(stream, &s, NULL);
    if (s.rejected > 0 || s.dropped > 0) code = 1;
  }
  // Waits for callbacks, so that the last line is the summary.
  selfcal_watch_destroy(watch);
  selfcal_stream_destroy(stream);
  selfcal_builder_destroy(builder);
  printf("segments: %" PRIu64 " stored, %" PRIu64 " known already, %" PRIu64
         " rejected\n",
         s.stored,
         s.duplicates,
         s.rejected);
  return code;
}

int main(int argc, char** argv) {
  selfcal_client_options options = SELFCAL_INIT(selfcal_client_options);
  rows imu, keyframes, observations;
  if (argc != 4 && argc != 5) {
    fprintf(stderr, "usage: %s TARGET RIG DIR [SPOOL_DIR]\n", argv[0]);
    return 2;
  }
  options.target = argv[1];
  options.rig = argv[2];
  if (argc == 5) options.spool_dir = argv[4];
  if (!open_rows(argv[3], "imu.csv", 6, &imu) ||
      !open_rows(argv[3], "keyframes.csv", 16, &keyframes) ||
      !open_rows(argv[3], "observations.csv", 7, &observations)) {
    return 2;
  }
  const int code = run(&options, &imu, &keyframes, &observations);
  fclose(imu.file);
  fclose(keyframes.file);
  fclose(observations.file);
  return code;
}
