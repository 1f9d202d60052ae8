// The recording that the examples in C++20 read: three files with
// comma-separated numbers, one record per line, in the order of time:
//
//   imu.csv           t_ns, gyroscope x y z [rad/s],
//                     accelerometer x y z [m/s^2]
//   keyframes.csv     t_ns, q_GI w x y z, p_GI x y z [m], v_GI x y z [m/s],
//                     b_a x y z [m/s^2], b_g x y z [rad/s]
//   observations.csv  t_ns of the keyframe, camera, landmark, u v [px],
//                     p_G x y z [m] of the landmark
#pragma once

#include <selfcal/segment_builder.h>

#include <charconv>
#include <cstdio>
#include <fstream>
#include <map>
#include <string>
#include <vector>

using Row = std::vector<double>;

// Parses a time and `count` numbers; false for any other line. The time is an
// integer, because a double cannot represent its nanoseconds.
inline bool Parse(const std::string& line,
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
  std::map<std::int64_t, std::vector<selfcal::client::KeyframeObservation>>
      observations;
};

inline bool Read(const std::string& dir, Recording* recording) {
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
