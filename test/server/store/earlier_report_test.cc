#include "server/store/earlier_report.h"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include "server/store/records.h"
#include "test/server/store/store_test.h"

namespace selfcal::server {
namespace {

using google::protobuf::FieldDescriptor;

// Sets every number of the report to another value.
store::EarlierReport Report() {
  store::EarlierReport report;
  const auto* reflection = report.GetReflection();
  const auto* descriptor = report.GetDescriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const FieldDescriptor* field = descriptor->field(i);
    if (field->is_repeated()) continue;
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_INT32) {
      reflection->SetInt32(&report, field, 100 + i);
    } else if (field->cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE) {
      reflection->SetDouble(&report, field, 1.0 / (3 + i));
    }
  }
  report.set_outcome(store::EarlierReport::STALLED);
  report.set_message("no step lowers the cost");
  report.add_held_constant()->set_information_ratio(0.25);
  report.add_noise_factors()->set_kind("gyro");
  auto* fit = report.add_fits();
  fit->set_session("a b");
  fit->set_index(3);
  fit->set_inertial_ratio(893);
  fit->mutable_others()->set_degrees(25);
  fit->set_excluded("a spike");
  report.mutable_halves()->set_degrees(26);
  report.mutable_evicted()->set_segments(9);
  return report;
}

TEST(EarlierReport, KeepsEveryField) {
  const store::EarlierReport earlier = Report();
  const v1::SolverReport report = Upgrade(earlier, "r");
  const auto* descriptor = earlier.GetDescriptor();
  int same = 0;
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const FieldDescriptor* field = descriptor->field(i);
    const FieldDescriptor* now =
        report.GetDescriptor()->FindFieldByName(field->name());
    if (now == nullptr || field->is_repeated()) continue;
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_INT32) {
      EXPECT_EQ(report.GetReflection()->GetInt32(report, now),
                earlier.GetReflection()->GetInt32(earlier, field))
          << field->name();
      ++same;
    } else if (field->cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE) {
      EXPECT_EQ(report.GetReflection()->GetDouble(report, now),
                earlier.GetReflection()->GetDouble(earlier, field))
          << field->name();
      ++same;
    }
  }
  EXPECT_EQ(same, 16);
  EXPECT_EQ(report.outcome(), v1::SolverReport::STALLED);
  EXPECT_EQ(report.message(), "no step lowers the cost");
  EXPECT_EQ(report.held_constant(0).information_ratio(), 0.25);
  EXPECT_EQ(report.noise_factors(0).kind(), "gyro");
  ASSERT_EQ(report.segment_fits_size(), 1);
  EXPECT_EQ(report.segment_fits(0).segment(), "rigs/r/segments/a%20b~3");
  EXPECT_EQ(report.segment_fits(0).inertial_ratio(), 893);
  EXPECT_EQ(report.segment_fits(0).others().degrees(), 25);
  EXPECT_EQ(report.segment_fits(0).excluded(), "a spike");
  EXPECT_EQ(report.halves().degrees(), 26);
  EXPECT_EQ(report.evicted().segments(), 9);
}

TEST(EarlierReport, IsReadWithItsCalibration) {
  const Rig rig = TestRig("r");
  StoredCalibration version;
  version.rig = "r";
  version.version = 2;
  version.theta = rig.factory;
  const int size = TangentSize(rig.factory);
  version.covariance = Eigen::MatrixXd::Identity(size, size);
  store::CalibrationRecord record;
  ASSERT_TRUE(record.ParseFromString(SerializeCalibration(version)));
  *record.mutable_earlier_report() = Report();

  const auto read = ParseCalibration(record.SerializeAsString(), "it");
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_TRUE(read->report.has_value());
  EXPECT_EQ(read->report->status, CalibrateStatus::kStalled);
  EXPECT_EQ(read->report->segment_fits[0].key, (SegmentKey{"a b", 3}));
  EXPECT_EQ(read->report->covariance, version.covariance);
}

}  // namespace
}  // namespace selfcal::server
