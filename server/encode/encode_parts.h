// Encoders of parts that several messages share; internal to server/encode.
#pragma once

#include <google/protobuf/timestamp.pb.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/calibration/calibrate.h"
#include "core/information/segment_information.h"
#include "selfcal/v1/calibration.pb.h"
#include "selfcal/v1/calibration_service.pb.h"

namespace selfcal::server {

inline void SetTime(std::int64_t time_ns, google::protobuf::Timestamp* time) {
  constexpr std::int64_t kNanoseconds = 1'000'000'000;
  time->set_seconds(time_ns / kNanoseconds);
  time->set_nanos(static_cast<std::int32_t>(time_ns % kNanoseconds));
}

template <typename Repeated>
void AddDirections(const std::vector<UnobservedDirection>& directions,
                   Repeated* messages) {
  for (const UnobservedDirection& direction : directions) {
    v1::UnobservedDirection* message = messages->Add();
    message->set_information_ratio(direction.information_ratio);
    for (const UnobservedDirection::Part& part : direction.parts) {
      v1::UnobservedDirection::Part* added = message->add_parts();
      added->set_component(part.component);
      added->set_weight(part.weight);
    }
  }
}

void FillReport(const std::string& rig,
                const CalibrationResult& result,
                double seconds,
                v1::SolverReport* message);

}  // namespace selfcal::server
