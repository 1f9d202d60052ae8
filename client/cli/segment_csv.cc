#include "client/cli/segment_csv.h"

#include <fmt/format.h>

#include "client/cli/csv_field.h"

namespace selfcal::client {
namespace {

// Appends element k of a column that has `width` numbers for each element.
template <typename Column>
void Append(const Column& column, int k, int width, std::string* row) {
  for (int i = width * k; i < width * (k + 1); ++i) {
    *row += fmt::format(",{}", column[i]);
  }
}

}  // namespace

const std::array<CsvFile, 4>& SegmentCsvFiles() {
  static const auto& files = *new std::array<CsvFile, 4>{{
      {"keyframes.csv",
       "session,index,t_ns,q_GI_w,q_GI_x,q_GI_y,q_GI_z,p_GI_x_m,p_GI_y_m,"
       "p_GI_z_m,v_GI_x_mps,v_GI_y_mps,v_GI_z_mps,b_a_x_mps2,b_a_y_mps2,"
       "b_a_z_mps2,b_g_x_radps,b_g_y_radps,b_g_z_radps\n"},
      {"imu.csv",
       "session,index,t_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,"
       "accel_x_mps2,accel_y_mps2,accel_z_mps2\n"},
      {"landmarks.csv", "session,index,id,p_G_x_m,p_G_y_m,p_G_z_m\n"},
      {"observations.csv",
       "session,index,keyframe,camera,landmark,z_x_px,z_y_px\n"},
  }};
  return files;
}

std::array<std::string, 4> SegmentCsvRows(const v1::MotionSegment& segment) {
  const std::string key =
      fmt::format("{},{}", CsvField(segment.session()), segment.index());
  std::array<std::string, 4> rows;
  const auto& keyframes = segment.keyframes();
  for (int k = 0; k < keyframes.t_ns_size(); ++k) {
    rows[0] += fmt::format("{},{}", key, keyframes.t_ns(k));
    Append(keyframes.q_gi(), k, 4, &rows[0]);
    Append(keyframes.p_gi(), k, 3, &rows[0]);
    Append(keyframes.v_gi(), k, 3, &rows[0]);
    Append(keyframes.b_a(), k, 3, &rows[0]);
    Append(keyframes.b_g(), k, 3, &rows[0]);
    rows[0] += '\n';
  }
  const auto& imu = segment.imu();
  for (int k = 0; k < imu.t_ns_size(); ++k) {
    rows[1] += fmt::format("{},{}", key, imu.t_ns(k));
    Append(imu.gyro(), k, 3, &rows[1]);
    Append(imu.accel(), k, 3, &rows[1]);
    rows[1] += '\n';
  }
  const auto& landmarks = segment.landmarks();
  for (int k = 0; k < landmarks.id_size(); ++k) {
    rows[2] += fmt::format("{},{}", key, landmarks.id(k));
    Append(landmarks.p_g(), k, 3, &rows[2]);
    rows[2] += '\n';
  }
  const auto& seen = segment.observations();
  for (int k = 0; k < seen.keyframe_size(); ++k) {
    rows[3] += fmt::format(
        "{},{},{},{}", key, seen.keyframe(k), seen.camera(k), seen.landmark(k));
    Append(seen.z_px(), k, 2, &rows[3]);
    rows[3] += '\n';
  }
  return rows;
}

}  // namespace selfcal::client
