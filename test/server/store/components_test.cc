// What a record has over the tangent space of theta is read by the names of its
// components.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "selfcal/store/records.pb.h"
#include "server/store/record_parts.h"
#include "server/store/records.h"
#include "server/store/segment_ends.h"
#include "test/server/store/fake_ends.h"
#include "test/server/store/fake_information.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

constexpr char kLacking[] = "imu.accel.misalignment.y";

std::vector<int> AllBut(int component, int size) {
  std::vector<int> rest;
  for (int i = 0; i < size; ++i) {
    if (i != component) rest.push_back(i);
  }
  return rest;
}

int Find(const Calibration& theta, const std::string& name) {
  const auto components = TangentComponents(theta);
  const auto found = std::find_if(
      components.begin(), components.end(), [&](const auto& component) {
        return component.name == name;
      });
  return static_cast<int>(found - components.begin());
}

// As from before there was the component.
void Remove(int component, ComponentNames* names) {
  names->DeleteSubrange(component, 1);
}
void Remove(int component, google::protobuf::RepeatedField<double>* values) {
  values->erase(values->begin() + component);
}

TEST(Components, InformationOfOneThatARecordLacksIsZero) {
  const Rig rig = TestRig("a");
  const SegmentInformation information = FakeInformation(rig, 1);
  const int size = TangentSize(rig.factory);
  const int lacking = Find(rig.factory, kLacking);
  const std::vector<int> rest = AllBut(lacking, size);
  store::SegmentInformationRecord record;
  ASSERT_TRUE(record.ParseFromString(SerializeInformation(information)));
  ASSERT_EQ(record.components(lacking), kLacking);
  PutMatrix(information.Lambda(rest, rest), record.mutable_lambda());
  Remove(lacking, record.mutable_eta());
  Remove(lacking, record.mutable_components());

  const auto read = ParseInformation(record.SerializeAsString(), "it");
  ASSERT_TRUE(read.ok()) << read.status();
  Eigen::MatrixXd Lambda = information.Lambda;
  Lambda.row(lacking).setZero();
  Lambda.col(lacking).setZero();
  Eigen::VectorXd eta = information.eta;
  eta[lacking] = 0;
  EXPECT_EQ(read->Lambda, Lambda);
  EXPECT_EQ(read->eta, eta);
}

TEST(Components, OrderIsThatOfTheNames) {
  const Rig rig = TestRig("a");
  const SegmentInformation information = FakeInformation(rig, 1);
  store::SegmentInformationRecord record;
  ASSERT_TRUE(record.ParseFromString(SerializeInformation(information)));
  std::vector<int> reversed = AllBut(-1, TangentSize(rig.factory));
  std::reverse(reversed.begin(), reversed.end());
  PutMatrix(information.Lambda(reversed, reversed), record.mutable_lambda());
  std::reverse(record.mutable_eta()->begin(), record.mutable_eta()->end());
  std::reverse(record.mutable_components()->begin(),
               record.mutable_components()->end());

  const auto read = ParseInformation(record.SerializeAsString(), "it");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->Lambda, information.Lambda);
  EXPECT_EQ(read->eta, information.eta);
}

TEST(Components, EndsKeepTheirStatesWithoutAComponent) {
  const Rig rig = TestRig("a");
  const SegmentEnds ends = FakeEnds(rig, {"session", 3});
  const int size = static_cast<int>(ends.eta.size());
  const int lacking = Find(rig.factory, kLacking);
  store::SegmentEndsRecord record;
  ASSERT_TRUE(record.ParseFromString(SerializeEnds(ends)));
  record.clear_lambda();
  for (const int i : AllBut(lacking, size)) {
    for (const int j : AllBut(lacking, size)) {
      if (j <= i) record.add_lambda(ends.Lambda(i, j));
    }
  }
  Remove(lacking, record.mutable_eta());
  Remove(lacking, record.mutable_components());

  const auto read = ParseEnds(record.SerializeAsString());
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->eta.size(), size);
  EXPECT_EQ(read->eta.tail(kEndUnknowns), ends.eta.tail(kEndUnknowns));
  EXPECT_EQ(read->eta[lacking], 0);
  EXPECT_TRUE(read->Lambda.row(lacking).isZero(0));
  EXPECT_EQ(read->Lambda.bottomRightCorner(kEndUnknowns, kEndUnknowns),
            ends.Lambda.bottomRightCorner(kEndUnknowns, kEndUnknowns));
  EXPECT_EQ(read->Lambda(size - 1, 0), ends.Lambda(size - 1, 0));
}

TEST(Components, OneThatALaterVersionLacksWasKnown) {
  const Rig rig = TestRig("a");
  const int size = TangentSize(rig.factory);
  const int lacking = Find(rig.factory, kLacking);
  const std::vector<int> rest = AllBut(lacking, size);
  StoredCalibration version;
  version.theta = rig.factory;
  version.covariance = Eigen::MatrixXd::Identity(size, size) / 7;
  CalibrateProgress step;
  step.theta = rig.factory;
  step.moved = Eigen::VectorXd::LinSpaced(size, 0, 1);
  step.sigmas = Eigen::VectorXd::LinSpaced(size, 1, 2);
  version.steps = {step};
  version.report.emplace().remembered.change_sigmas = step.sigmas;
  store::CalibrationRecord record;
  ASSERT_TRUE(record.ParseFromString(SerializeCalibration(version)));
  PutMatrix(version.covariance(rest, rest), record.mutable_covariance());
  Remove(lacking, record.mutable_components());
  Remove(lacking, record.mutable_steps(0)->mutable_moved());
  Remove(lacking, record.mutable_steps(0)->mutable_sigmas());
  Remove(lacking,
         record.mutable_report()->mutable_evicted()->mutable_change_sigmas());

  const auto read = ParseCalibration(record.SerializeAsString(), "it");
  ASSERT_TRUE(read.ok()) << read.status();
  version.covariance(lacking, lacking) = 0;
  step.moved[lacking] = step.sigmas[lacking] = 0;
  EXPECT_EQ(read->covariance, version.covariance);
  EXPECT_EQ(read->steps[0].moved, step.moved);
  EXPECT_EQ(read->steps[0].sigmas, step.sigmas);
  EXPECT_EQ(read->report->remembered.change_sigmas, step.sigmas);
}

TEST(Components, RecordWithAnUnknownOneCannotBeRead) {
  const Rig rig = TestRig("a");
  store::SegmentInformationRecord record;
  ASSERT_TRUE(
      record.ParseFromString(SerializeInformation(FakeInformation(rig, 1))));
  record.set_components(2, "imu.gyro.unheard_of.x");
  EXPECT_TRUE(absl::IsDataLoss(
      ParseInformation(record.SerializeAsString(), "it").status()));
}

}  // namespace
}  // namespace selfcal::server
