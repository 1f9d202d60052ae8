#include "server/encode/encode_coaching.h"

#include <algorithm>
#include <string>
#include <vector>

namespace selfcal::server {
namespace {

void Fill(const Advice& advice, v1::AdviseMotionResponse::Advice* to) {
  to->set_motion(std::string(advice.motion));
  to->set_instruction(std::string(advice.instruction));
  to->set_gain_nats(advice.gain_nats);
  for (const GroupGain& group : advice.groups) {
    auto* gain = to->add_group_gains();
    gain->set_group(group.group);
    gain->set_gain_nats(group.gain_nats);
  }
  for (const SigmaChange& sigma : advice.sigmas) {
    auto* change = to->add_sigma_changes();
    change->set_component(sigma.component);
    change->set_unit(sigma.unit);
    change->set_sigma_now(sigma.sigma_now);
    change->set_sigma_after(sigma.sigma_after);
  }
}

void FillParts(
    const std::vector<UnobservedDirection::Part>& parts,
    google::protobuf::RepeatedPtrField<v1::UnobservedDirection::Part>* to) {
  for (const UnobservedDirection::Part& part : parts) {
    auto* added = to->Add();
    added->set_component(part.component);
    added->set_weight(part.weight);
  }
}

void Fill(const Plan& plan,
          double segment_s,
          v1::AdviseMotionResponse* response) {
  for (const Lesson& lesson : plan.lessons) {
    auto* to = response->add_lessons();
    to->set_motion(std::string(lesson.motion));
    to->set_instruction(std::string(lesson.instruction));
    to->set_seconds(lesson.segments * segment_s);
  }
  for (const MissingDirection& missing : plan.missing) {
    auto* to = response->add_missing();
    to->set_words(missing.words);
    FillParts(missing.parts, to->mutable_parts());
    to->set_sigma_by_prior(missing.sigma);
    to->set_sigma_by_prior_after(missing.sigma_after);
    to->set_motion(std::string(missing.motion));
  }
}

}  // namespace

v1::AdviseMotionResponse Encode(const RigCoaching& coaching, int max_advice) {
  v1::AdviseMotionResponse response;
  const auto& advice = coaching.coaching.advice;
  const std::size_t count =
      std::min(static_cast<std::size_t>(max_advice), advice.size());
  for (std::size_t i = 0; i < count; ++i) {
    Fill(advice[i], response.add_advice());
  }
  for (const WeakDirection& direction : coaching.coaching.weakest) {
    auto* weak = response.add_weakest();
    weak->set_words(direction.words);
    weak->set_sigma_by_reference(direction.sigma);
    FillParts(direction.parts, weak->mutable_parts());
  }
  Fill(coaching.plan, coaching.segment_s, &response);
  response.set_calibration_version(coaching.calibration_version);
  response.set_segments_since(coaching.segments_since);
  response.set_segment_seconds(coaching.segment_s);
  return response;
}

}  // namespace selfcal::server
