#include "proto/field_paths.h"

#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include "core/model/rig.h"
#include "selfcal/v1/rig.pb.h"

namespace selfcal {
namespace {

// Whether a path, without its indices, leads through fields of the message.
bool Exists(const google::protobuf::Descriptor* message, std::string path) {
  while (message != nullptr) {
    const std::size_t dot = path.find('.');
    const std::string part = path.substr(0, dot);
    const auto* field =
        message->FindFieldByName(part.substr(0, part.find('[')));
    if (field == nullptr) return false;
    if (dot == path.npos) return true;
    path = path.substr(dot + 1);
    message = field->message_type();
  }
  return false;
}

TEST(FieldPaths, SegmentFieldsAreThoseOfTheMessage) {
  EXPECT_EQ(SegmentFieldPath("key.session"), "session");
  EXPECT_EQ(SegmentFieldPath("key.index"), "index");
  EXPECT_EQ(SegmentFieldPath("keyframes[3].q_GI"), "keyframes[3].q_gi");
  EXPECT_EQ(SegmentFieldPath("landmarks[0].p_G"), "landmarks[0].p_g");
  EXPECT_EQ(SegmentFieldPath("observations[2]"), "observations[2]");
  EXPECT_EQ(SegmentFieldPath(""), "");
}

TEST(FieldPaths, WhatValidationSaysOfARigIsAFieldOfTheMessage) {
  Rig rig;
  rig.groups = {{"No Name", {"nothing"}}, {"", {}}};
  rig.prior_sigmas = {{"nothing", -1}};
  rig.fixed = {"nothing"};
  rig.factory.cameras.resize(1);
  rig.factory.cameras[0].q_CI.w() = 2;
  rig.factory.cameras[0].p_CI.x() = 1e9;
  rig.factory.cameras[0].time_offset_s = 2;
  rig.factory.imu.q_AI.w() = 2;
  rig.imu_noise = {0, 0, 0, 0};
  rig.gravity_mps2 = -1;
  rig.table_size = -1;
  rig.min_gain_nats = -1;
  rig.retrigger_fraction = -1;
  rig.pixel_sigma_px = 0;
  const auto violations = Validate(rig);
  EXPECT_GT(violations.size(), 15u);
  for (const Violation& violation : violations) {
    EXPECT_TRUE(Exists(v1::Rig::descriptor(), RigFieldPath(violation.field)))
        << violation.field;
  }
}

}  // namespace
}  // namespace selfcal
