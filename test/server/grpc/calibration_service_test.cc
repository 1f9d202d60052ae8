#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "core/model/so3.h"
#include "server/encode/compare.h"
#include "server/encode/encode.h"
#include "server/store/change_rows.h"
#include "test/core/simulation/rigs.h"
#include "test/server/grpc/service_test.h"

namespace selfcal::server {
namespace {

using ::testing::ElementsAre;

class CalibrationServiceTest : public ServiceTest {
 protected:
  // A rig whose second version is active.
  Rig AddCalibrated() {
    Rig rig = AddScored(1);
    const auto run = domain_->CreateManualRun(rig.id);
    EXPECT_TRUE(run.ok()) << run.status();
    FinishRun(rig, run->run);
    return rig;
  }

  grpc::Status Get(const std::string& name, v1::Calibration* calibration) {
    Context context;
    v1::GetCalibrationRequest request;
    request.set_name(name);
    return calibrations_->GetCalibration(&context, request, calibration);
  }

  grpc::Status List(const std::string& parent,
                    int size,
                    const std::string& token,
                    v1::ListCalibrationsResponse* response) {
    Context context;
    v1::ListCalibrationsRequest request;
    request.set_parent(parent);
    request.set_page_size(size);
    request.set_page_token(token);
    return calibrations_->ListCalibrations(&context, request, response);
  }

  grpc::Status Activate(const std::string& name,
                        const std::string& reason,
                        v1::Calibration* calibration) {
    Context context;
    v1::ActivateCalibrationRequest request;
    request.set_name(name);
    request.set_reason(reason);
    return calibrations_->ActivateCalibration(&context, request, calibration);
  }

  std::unique_ptr<grpc::ClientReader<v1::Calibration>> Watch(
      Context* context, const std::string& parent) {
    v1::WatchCalibrationRequest request;
    request.set_parent(parent);
    return calibrations_->WatchCalibration(context, request);
  }
};

TEST_F(CalibrationServiceTest, VersionShowsEstimatesWithSigmas) {
  const Rig rig = AddCalibrated();
  v1::Calibration read;
  ASSERT_TRUE(Get("rigs/r/calibrations/2", &read).ok());
  const auto components = TangentComponents(rig.factory);
  const Eigen::VectorXd values = ReadableValues(rig.factory);
  const int size = static_cast<int>(components.size());
  ASSERT_EQ(read.estimates_size(), size);
  for (int i = 0; i < size; ++i) {
    EXPECT_EQ(read.estimates(i).component(), components[i].name);
    EXPECT_EQ(read.estimates(i).unit(), components[i].unit);
    EXPECT_EQ(read.estimates(i).value(), values[i]);
    EXPECT_EQ(read.estimates(i).sigma(), 2);
  }
  EXPECT_EQ(read.covariance_size(), size * (size + 1) / 2);
}

TEST_F(CalibrationServiceTest, VersionWithSlopesIsReadAtATemperature) {
  Rig rig = TestRig("warm");
  rig.factory.cameras[0].f_slope = Eigen::Vector2d(0.05, 0.04);
  rig.blocks = {{"cam0.focal_slope", true}};
  ASSERT_TRUE(domain_->CreateRig(rig).ok());
  v1::Calibration stored, read;
  ASSERT_TRUE(Get("rigs/warm/calibrations/1", &stored).ok());
  EXPECT_EQ(stored.temperature_c(), 25);
  EXPECT_EQ(stored.parameters().reference_temperature_c(), 25);
  v1::GetCalibrationRequest request;
  request.set_name("rigs/warm/calibrations/1");
  request.set_temperature_c(45);
  const auto get = [&] {
    Context context;
    return calibrations_->GetCalibration(&context, request, &read);
  };
  ASSERT_TRUE(get().ok());
  EXPECT_EQ(read.temperature_c(), 45);
  EXPECT_EQ(read.parameters().cameras(0).f_slope_size(), 0);
  EXPECT_NEAR(read.parameters().cameras(0).f().x(),
              stored.parameters().cameras(0).f().x() + 20 * 0.05,
              1e-9);
  ASSERT_EQ(read.estimates_size() + 2, stored.estimates_size());
  const int slope = stored.estimates_size() - 2;
  EXPECT_EQ(stored.estimates(slope).component(), "cam0.focal_slope.x");
  for (int i = 0; i < read.estimates_size(); ++i) {
    const auto& now = read.estimates(i);
    EXPECT_EQ(now.component(), stored.estimates(i).component());
    EXPECT_EQ(now.from_factory(), 0);
    const double more =
        now.component() == "cam0.focal.x" || now.component() == "cam0.focal.y"
            ? 20 * stored.estimates(slope).sigma()
            : 0;
    EXPECT_NEAR(
        now.sigma(), std::hypot(stored.estimates(i).sigma(), more), 1e-9)
        << now.component();
  }
  request.set_temperature_c(1000);
  EXPECT_EQ(get().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  // A rig without slopes is the same at every temperature.
  AddRig();
  request.set_name("rigs/r/calibrations/1");
  request.set_temperature_c(45);
  ASSERT_TRUE(get().ok());
  EXPECT_FALSE(read.has_temperature_c());
}

TEST_F(CalibrationServiceTest, VersionShowsWhereItCameFrom) {
  AddCalibrated();
  v1::Calibration read;
  ASSERT_TRUE(Get("rigs/r/calibrations/2", &read).ok());
  EXPECT_EQ(read.version(), 2);
  EXPECT_EQ(read.state(), v1::Calibration::ACTIVE);
  EXPECT_EQ(read.provenance().recalibration(), "rigs/r/recalibrations/1");
  EXPECT_EQ(read.provenance().base_version(), 1);
  EXPECT_EQ(read.provenance().program_version(), "test");
  EXPECT_THAT(read.provenance().segments(), ElementsAre("rigs/r/segments/s~0"));
  EXPECT_EQ(read.solver().status(), "converged");
  EXPECT_EQ(read.solver().iterations(), 7);
}

TEST_F(CalibrationServiceTest, VersionShowsTheTemperaturesOfItsSegments) {
  const Rig rig = AddRig();
  auto segments = TestSegments(rig, 2);
  segments[0].temperature_c = 20;
  segments[1].temperature_c = 31;
  for (const MotionSegment& segment : segments) {
    ASSERT_TRUE(domain_->PutSegment("r", segment).ok());
    Score(rig, segment.key, 10);
  }
  FinishRun(rig, 1);
  v1::Calibration read;
  ASSERT_TRUE(Get("rigs/r/calibrations/2", &read).ok());
  const auto& temperature = read.provenance().temperature();
  EXPECT_EQ(temperature.segments(), 2);
  EXPECT_EQ(temperature.mean_c(), 25.5);
  EXPECT_EQ(temperature.min_c(), 20);
  EXPECT_EQ(temperature.max_c(), 31);
  ASSERT_TRUE(Get("rigs/r/calibrations/1", &read).ok());
  EXPECT_FALSE(read.provenance().has_temperature());
}

TEST_F(CalibrationServiceTest, ActiveIsTheNewestThatWasPublished) {
  AddCalibrated();
  v1::Calibration read;
  ASSERT_TRUE(Get("rigs/r/calibrations/active", &read).ok());
  EXPECT_EQ(read.name(), "rigs/r/calibrations/2");
  ASSERT_TRUE(Get("rigs/r/calibrations/1", &read).ok());
  EXPECT_EQ(read.state(), v1::Calibration::SUPERSEDED);
}

TEST_F(CalibrationServiceTest, VersionThatDoesNotExistIsNotFound) {
  v1::Calibration read;
  ExpectNotFound(Get("rigs/r/calibrations/active", &read),
                 "rigs/r/calibrations/active");
  AddRig();
  ExpectNotFound(Get("rigs/r/calibrations/7", &read), "rigs/r/calibrations/7");
}

TEST_F(CalibrationServiceTest, WhatIsNoNameIsRefused) {
  AddRig();
  v1::Calibration read;
  for (const std::string name : {"rigs/r",
                                 "rigs/r/calibrations/",
                                 "rigs/r/calibrations/0",
                                 "rigs/r/calibrations/-1",
                                 "rigs/r/calibrations/01",
                                 "rigs/r/calibrations/newest",
                                 "rigs/r/calibrations/99999999999999999999"}) {
    EXPECT_THAT(BadFields(Get(name, &read)), ElementsAre("name")) << name;
  }
}

TEST_F(CalibrationServiceTest, PagesHoldEveryVersionNewestFirst) {
  AddCalibrated();
  v1::ListCalibrationsResponse page;
  ASSERT_TRUE(List("rigs/r", 1, "", &page).ok());
  ASSERT_EQ(page.calibrations_size(), 1);
  EXPECT_EQ(page.calibrations(0).version(), 2);
  const std::string token = page.next_page_token();
  ASSERT_TRUE(List("rigs/r", 1, token, &page).ok());
  ASSERT_EQ(page.calibrations_size(), 1);
  EXPECT_EQ(page.calibrations(0).version(), 1);
}

TEST_F(CalibrationServiceTest, ABasicListLacksTheDetails) {
  AddCalibrated();
  v1::ListCalibrationsResponse full;
  ASSERT_TRUE(List("rigs/r", 0, "", &full).ok());
  Context context;
  v1::ListCalibrationsRequest request;
  request.set_parent("rigs/r");
  request.set_view(v1::ListCalibrationsRequest::BASIC);
  v1::ListCalibrationsResponse basic;
  ASSERT_TRUE(calibrations_->ListCalibrations(&context, request, &basic).ok());
  ASSERT_EQ(basic.calibrations_size(), full.calibrations_size());
  for (int k = 0; k < full.calibrations_size(); ++k) {
    v1::Calibration expected = full.calibrations(k);
    EXPECT_GT(expected.covariance_size(), 0);
    EXPECT_GT(expected.estimates_size(), 0);
    expected.clear_covariance();
    expected.clear_estimates();
    if (expected.has_provenance()) {
      EXPECT_GT(expected.provenance().segments_size(), 0);
      expected.mutable_provenance()->clear_settings();
    }
    if (expected.has_solver()) {
      expected.mutable_solver()->clear_segment_fits();
    }
    EXPECT_EQ(basic.calibrations(k).SerializeAsString(),
              expected.SerializeAsString());
  }
}

TEST_F(CalibrationServiceTest, APageHasFewerVersionsWithDetails) {
  for (int i = 0; i < 17; ++i) {
    ASSERT_TRUE(domain_->CreateRig(TestRig("r" + std::to_string(i))).ok());
  }
  v1::ListCalibrationsResponse page;
  ASSERT_TRUE(List("", 0, "", &page).ok());
  EXPECT_EQ(page.calibrations_size(), 15);
  ASSERT_TRUE(List("", 1000, page.next_page_token(), &page).ok());
  EXPECT_EQ(page.calibrations_size(), 2);
  EXPECT_EQ(page.next_page_token(), "");
  Context context;
  v1::ListCalibrationsRequest request;
  request.set_view(v1::ListCalibrationsRequest::BASIC);
  ASSERT_TRUE(calibrations_->ListCalibrations(&context, request, &page).ok());
  EXPECT_EQ(page.calibrations_size(), 17);
}

// The filter finds a version by the verdict that the list shows, whatever
// record has changed that.
TEST_F(CalibrationServiceTest, AFilterMeetsTheVerdictThatIsShown) {
  const Rig rig = AddCalibrated();
  const auto expect_shown = [&](const std::vector<v1::Verdict::Kind>& newest) {
    v1::ListCalibrationsResponse all;
    ASSERT_TRUE(List("rigs/r", 0, "", &all).ok());
    std::vector<v1::Verdict::Kind> shown;
    for (const auto& version : all.calibrations()) {
      shown.push_back(version.verdict().kind());
    }
    EXPECT_EQ(shown, newest);
    for (int kind = 0; kind < v1::Verdict::Kind_ARRAYSIZE; ++kind) {
      const auto wanted = static_cast<v1::Verdict::Kind>(kind);
      Context context;
      v1::ListCalibrationsRequest request;
      request.set_filter("verdict = " + v1::Verdict::Kind_Name(wanted));
      request.set_order_by("create_time asc");
      v1::ListCalibrationsResponse found;
      ASSERT_TRUE(
          calibrations_->ListCalibrations(&context, request, &found).ok());
      EXPECT_EQ(found.calibrations_size(),
                std::count(newest.begin(), newest.end(), wanted));
      for (const auto& version : found.calibrations()) {
        EXPECT_EQ(version.verdict().kind(), wanted);
      }
    }
  };
  const auto activate = [&](std::int64_t version) {
    return domain_->ActivateCalibration("r", version, "eve", "trial").ok();
  };
  expect_shown({v1::Verdict::UNKNOWN, v1::Verdict::FACTORY});
  StoredChange change;
  change.rig = "r";
  change.change = 1;
  change.time_ns = 1;
  change.base_version = 1;
  change.first_sequence = 1;
  ASSERT_TRUE(
      store_
          ->Transact(
              "r", 1, [&](UnitOfWork* tx) { return InsertChange(tx, change); })
          .ok());
  expect_shown({v1::Verdict::NOT_TRUSTWORTHY, v1::Verdict::FACTORY});
  ASSERT_TRUE(activate(1));
  expect_shown({v1::Verdict::UNKNOWN, v1::Verdict::FACTORY});
  ASSERT_TRUE(activate(2));
  expect_shown({v1::Verdict::NOT_TRUSTWORTHY, v1::Verdict::FACTORY});
  ASSERT_TRUE(activate(1));
  ASSERT_TRUE(domain_->ReportDisagreement("r", 2, "by 3 sigma").ok());
  expect_shown({v1::Verdict::NOT_TRUSTWORTHY, v1::Verdict::FACTORY});
  const auto run = domain_->CreateManualRun("r", true);
  ASSERT_TRUE(run.ok()) << run.status();
  ASSERT_TRUE(domain_->BeginRun("r", run->run).ok());
  StoredCalibration rejected =
      TestCalibration(rig, *store_->GetRun("r", run->run));
  rejected.state = CalibrationState::kRejected;
  rejected.verdict.kind = VerdictKind::kGood;
  ASSERT_TRUE(domain_->FinishRun("r", run->run, rejected).ok());
  expect_shown({v1::Verdict::NOT_TRUSTWORTHY,
                v1::Verdict::NOT_TRUSTWORTHY,
                v1::Verdict::FACTORY});
}

TEST_F(CalibrationServiceTest, AFaultyFilterOrOrderIsRefused) {
  AddRig();
  v1::ListCalibrationsResponse page;
  for (const std::string parent : {"", "rigs/r"}) {
    v1::ListCalibrationsRequest request;
    request.set_parent(parent);
    request.set_filter("verdict = bad");
    Context first;
    EXPECT_THAT(
        BadFields(calibrations_->ListCalibrations(&first, request, &page)),
        ElementsAre("filter"));
    request.clear_filter();
    request.set_order_by("verdict");
    Context second;
    EXPECT_THAT(
        BadFields(calibrations_->ListCalibrations(&second, request, &page)),
        ElementsAre("order_by"));
  }
}

TEST_F(CalibrationServiceTest, ListOfAnUnknownRigOrPageIsRefused) {
  v1::ListCalibrationsResponse page;
  EXPECT_THAT(BadFields(List("r", 0, "", &page)), ElementsAre("parent"));
  ExpectNotFound(List("rigs/r", 0, "", &page), "rigs/r");
  AddRig();
  EXPECT_THAT(BadFields(List("rigs/r", -1, "", &page)),
              ElementsAre("page_size"));
  EXPECT_THAT(BadFields(List("rigs/r", 1, "x", &page)),
              ElementsAre("page_token"));
}

TEST_F(CalibrationServiceTest, ListWithoutAParentIsOfAllRigs) {
  v1::ListCalibrationsResponse page;
  ASSERT_TRUE(List("", 0, "", &page).ok());
  EXPECT_EQ(page.calibrations_size(), 0);
  AddRig();
  ASSERT_TRUE(List("", 0, "", &page).ok());
  ASSERT_EQ(page.calibrations_size(), 1);
  EXPECT_EQ(page.calibrations(0).name(), "rigs/r/calibrations/1");
}

TEST_F(CalibrationServiceTest, WatchBeginsWithTheActiveAndGetsTheNext) {
  const Rig rig = AddScored(1);
  Context context;
  const auto reader = Watch(&context, "rigs/r");
  v1::Calibration seen;
  ASSERT_TRUE(reader->Read(&seen));
  EXPECT_EQ(seen.version(), 1);
  const auto run = domain_->CreateManualRun(rig.id);
  ASSERT_TRUE(run.ok());
  pipeline_->Publish(FinishRun(rig, run->run));
  ASSERT_TRUE(reader->Read(&seen));
  EXPECT_EQ(seen.version(), 2);
  context.TryCancel();
  EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(Eventually([&] { return pipeline_->watchers() == 0; }));
}

TEST_F(CalibrationServiceTest, WatchIsToldOfARollBackAndNoneTwice) {
  AddCalibrated();
  Context context;
  const auto reader = Watch(&context, "rigs/r");
  v1::Calibration seen;
  ASSERT_TRUE(reader->Read(&seen));
  EXPECT_EQ(seen.version(), 2);
  v1::Calibration active;
  ASSERT_TRUE(Activate("rigs/r/calibrations/1", "drifts", &active).ok());
  EXPECT_EQ(active.version(), 1);
  EXPECT_EQ(active.state(), v1::Calibration::ACTIVE);
  ASSERT_TRUE(reader->Read(&seen));
  EXPECT_EQ(seen.version(), 1);
  // What the reader has, activated once more, is not told.
  pipeline_->Publish(*store_->GetActiveCalibration("r"));
  ASSERT_TRUE(Activate("rigs/r/calibrations/2", "fine", &active).ok());
  ASSERT_TRUE(reader->Read(&seen));
  EXPECT_EQ(seen.version(), 2);
  context.TryCancel();
  reader->Finish();
}

TEST_F(CalibrationServiceTest, WatchIsToldOnceThatAVersionIsNotTrustworthy) {
  AddCalibrated();
  Context context;
  const auto reader = Watch(&context, "rigs/r");
  v1::Calibration seen;
  ASSERT_TRUE(reader->Read(&seen));
  EXPECT_EQ(seen.version(), 2);
  EXPECT_NE(seen.verdict().kind(), v1::Verdict::NOT_TRUSTWORTHY);
  ASSERT_TRUE(domain_->ReportDisagreement("r", 2, "the cores disagree").ok());
  for (int i = 0; i < 2; ++i) {
    pipeline_->Publish(*store_->GetActiveCalibration("r"));
  }
  ASSERT_TRUE(reader->Read(&seen));
  EXPECT_EQ(seen.version(), 2);
  EXPECT_EQ(seen.verdict().kind(), v1::Verdict::NOT_TRUSTWORTHY);
  v1::Calibration active;
  ASSERT_TRUE(Activate("rigs/r/calibrations/1", "drifts", &active).ok());
  ASSERT_TRUE(reader->Read(&seen));
  EXPECT_EQ(seen.version(), 1);
  context.TryCancel();
  reader->Finish();
}

TEST_F(CalibrationServiceTest, RolledBackVersionSaysSo) {
  AddCalibrated();
  v1::Calibration read;
  ASSERT_TRUE(Activate("rigs/r/calibrations/1", "drifts", &read).ok());
  ASSERT_TRUE(Get("rigs/r/calibrations/2", &read).ok());
  EXPECT_EQ(read.state(), v1::Calibration::ROLLED_BACK);
  ASSERT_TRUE(Get("rigs/r/calibrations/active", &read).ok());
  EXPECT_EQ(read.version(), 1);
  const StoredEvent event = store_->ListEvents({1000, ""})->items.back();
  EXPECT_EQ(event.kind, EventKind::kCalibrationRolledBack);
  EXPECT_THAT(event.detail, ::testing::HasSubstr("by local"));
  EXPECT_THAT(event.detail, ::testing::HasSubstr("drifts"));
}

TEST_F(CalibrationServiceTest, ActivationNeedsAVersionAndAReason) {
  AddCalibrated();
  v1::Calibration read;
  for (const std::string name :
       {"rigs/r", "rigs/r/calibrations/active", "rigs/r/calibrations/x"}) {
    EXPECT_THAT(BadFields(Activate(name, "why", &read)), ElementsAre("name"));
  }
  EXPECT_THAT(BadFields(Activate("rigs/r/calibrations/1", "", &read)),
              ElementsAre("reason"));
  EXPECT_THAT(BadFields(Activate(
                  "rigs/r/calibrations/1", std::string(501, 'x'), &read)),
              ElementsAre("reason"));
  ExpectNotFound(Activate("rigs/r/calibrations/9", "why", &read),
                 "rigs/r/calibrations/9");
  EXPECT_EQ(store_->GetActiveCalibration("r")->version, 2);
}

TEST_F(CalibrationServiceTest, WhatItWasJudgedByIsShown) {
  const Rig rig = AddScored(1);
  const auto run = domain_->CreateManualRun(rig.id);
  ASSERT_TRUE(domain_->BeginRun(rig.id, run->run).ok());
  StoredCalibration rejected = *store_->GetActiveCalibration(rig.id);
  rejected.state = CalibrationState::kRejected;
  rejected.reasons = {"does not fit"};
  rejected.settings = {{"loss", "huber"}};
  rejected.validation = StoredValidation();
  rejected.validation->active_version = 1;
  rejected.validation->checks = {
      {"held_out_probability", 0.5e-9, 1e-4, CheckOutcome::kFailed, "No fit."},
      {"halves", 0, 1e-4, CheckOutcome::kNotTested, "Too few."}};
  rejected.validation->held_out = {5, 3, {99, 26, 0.5e-9}, {20, 26, 0.8}, 4};
  rejected.verdict = {VerdictKind::kNotTrustworthy, {"does not fit"}};
  rejected.report = CalibrationResult();
  rejected.report->segment_fits = {{{"s", 0}, 1.5, 893, {}, "a spike"}};
  rejected.report->halves = {30, 26, 0.25};
  rejected.report->noise_scales = {{NoiseKind::kGyro, 3, 0.05, 100, 2.9, true}};
  ASSERT_TRUE(domain_->FinishRun(rig.id, run->run, rejected).ok());
  v1::Calibration read;
  ASSERT_TRUE(Get("rigs/r/calibrations/2", &read).ok());
  EXPECT_EQ(read.validation().verdict(), v1::Validation::REJECTED);
  ASSERT_EQ(read.validation().checks_size(), 2);
  EXPECT_EQ(read.validation().checks(0).value(), 0.5e-9);
  EXPECT_FALSE(read.validation().checks(0).passed());
  EXPECT_EQ(read.validation().checks(0).outcome(),
            v1::Validation::Check::FAILED);
  EXPECT_EQ(read.validation().checks(0).sentence(), "No fit.");
  EXPECT_FALSE(read.validation().checks(1).passed());
  EXPECT_EQ(read.validation().checks(1).outcome(),
            v1::Validation::Check::NOT_TESTED);
  EXPECT_EQ(read.verdict().kind(), v1::Verdict::NOT_TRUSTWORTHY);
  EXPECT_EQ(read.verdict().text(), "not trustworthy");
  EXPECT_THAT(read.verdict().sentences(), ElementsAre("does not fit"));
  ASSERT_EQ(read.solver().segment_fits_size(), 1);
  EXPECT_EQ(read.solver().segment_fits(0).segment(), "rigs/r/segments/s~0");
  EXPECT_EQ(read.solver().segment_fits(0).inertial_ratio(), 893);
  EXPECT_EQ(read.solver().segment_fits(0).excluded(), "a spike");
  EXPECT_EQ(read.solver().halves().chi_square(), 30);
  EXPECT_EQ(read.solver().halves().probability(), 0.25);
  EXPECT_EQ(read.solver().noise_factors(0).used(), 2.9);
  EXPECT_TRUE(read.solver().noise_factors(0).converged());
  EXPECT_EQ(read.validation().held_out().left_out(), 3);
  EXPECT_EQ(read.validation().held_out().rescored(), 4);
  EXPECT_EQ(read.validation().held_out().chi_square(), 99);
  EXPECT_EQ(read.validation().held_out().active_probability(), 0.8);
  ASSERT_EQ(read.provenance().settings_size(), 1);
  EXPECT_EQ(read.provenance().settings(0).name(), "loss");
  EXPECT_GE(read.provenance().schema_version(), 3);
  EXPECT_EQ(Activate("rigs/r/calibrations/2", "why not", &read).error_code(),
            grpc::StatusCode::FAILED_PRECONDITION);
}

// Near pi the rotation vectors of two versions point to opposite sides.
TEST_F(CalibrationServiceTest, RotationsAreToldFromTheFactorys) {
  Rig rig = TestRig("turned");
  constexpr double kPi = std::numbers::pi;
  rig.factory.cameras[0].q_CI = Exp({kPi - 0.001, 0, 0});
  const auto estimate = [&](const Calibration& theta) {
    StoredCalibration version;
    version.rig = rig.id;
    version.theta = theta;
    const v1::Calibration encoded = Encode(version, StoredRig{rig});
    for (const auto& one : encoded.estimates()) {
      if (one.component() == "cam0.q_CI.x") return one;
    }
    ADD_FAILURE();
    return v1::ComponentEstimate();
  };
  const auto before = estimate(rig.factory);
  Calibration turned = rig.factory;
  turned.cameras[0].q_CI = turned.cameras[0].q_CI * Exp({0.003, 0, 0});
  const auto after = estimate(turned);
  EXPECT_GT(std::abs(after.value() - before.value()), 6);
  EXPECT_NEAR(before.from_factory(), 0, 1e-12);
  EXPECT_NEAR(after.from_factory(), 0.003, 1e-9);
}

TEST_F(CalibrationServiceTest, SigmasComeWithTheWalkOfTheRig) {
  StoredRig rig{TestRig("old")};
  rig.policy.walk_densities = {{"cam0.focal.x", 0.3}};
  StoredCalibration version;
  version.rig = "old";
  version.theta = rig.rig.factory;
  int stated = 0;
  const v1::Calibration encoded = Encode(version, rig);
  for (const auto& estimate : encoded.estimates()) {
    if (estimate.component() == "cam0.focal.x") {
      EXPECT_EQ(estimate.walk(), 0.3);
      ++stated;
    } else {
      EXPECT_NE(estimate.walk(), 0.3) << estimate.component();
    }
  }
  EXPECT_EQ(stated, 1);
}

TEST_F(CalibrationServiceTest, VersionsAreCompared) {
  const Rig rig = AddCalibrated();
  Context context;
  v1::CompareCalibrationsRequest request;
  request.set_a("rigs/r/calibrations/1");
  request.set_b("rigs/r/calibrations/active");
  v1::CompareCalibrationsResponse compared;
  ASSERT_TRUE(
      calibrations_->CompareCalibrations(&context, request, &compared).ok());
  EXPECT_EQ(compared.version_a(), 1);
  EXPECT_EQ(compared.version_b(), 2);
  EXPECT_EQ(compared.differences_size(),
            static_cast<int>(FreeComponents(rig).size()));
  EXPECT_EQ(compared.differences(0).component(), "imu.gyro.scale.x");
  EXPECT_EQ(compared.differences(0).difference(), 0);
  EXPECT_GT(compared.differences(0).sigma(), 2);
  EXPECT_FALSE(compared.significant());
  Context other;
  AddRig("other");
  request.set_b("rigs/other/calibrations/1");
  EXPECT_THAT(
      BadFields(calibrations_->CompareCalibrations(&other, request, &compared)),
      ElementsAre("b"));
  Context missing;
  request.set_b("rigs/r/calibrations/7");
  ExpectNotFound(
      calibrations_->CompareCalibrations(&missing, request, &compared),
      "rigs/r/calibrations/7");
}

// A component of each block that few rigs have, with its unit.
constexpr std::pair<const char*, const char*> kOptionalComponents[] = {
    {"imu.gyro.g_sensitivity.x.y", "rad s/m"},
    {"imu.accel.position.y.z", "m"},
    {"imu1.gyro.scale.x", "-"},
    {"imu1.gyro.misalignment.x", "-"},
    {"imu1.accel.scale.x", "-"},
    {"imu1.accel.misalignment.x", "-"},
    {"imu1.q_AI.x", "rad"},
    {"imu1.gyro.g_sensitivity.z.x", "rad s/m"},
    {"imu1.accel.position.z.y", "m"},
    {"imu1.q_JI.y", "rad"},
    {"imu1.p_JI.y", "m"},
    {"imu1.time_offset", "s"},
    {"cam0.time_offset", "s"},
    {"cam0.line_delay", "s"},
    {"cam0.time_drift", "s/s"},
    {"imu.gyro.scale_slope.x", "1/K"},
    {"imu.gyro.misalignment_slope.y", "1/K"},
    {"imu.accel.scale_slope.z", "1/K"},
    {"imu.accel.misalignment_slope.x", "1/K"},
    {"imu.q_AI_slope.y", "rad/K"},
    {"imu1.gyro.scale_slope.x", "1/K"},
    {"imu1.gyro.misalignment_slope.y", "1/K"},
    {"imu1.accel.scale_slope.z", "1/K"},
    {"imu1.accel.misalignment_slope.x", "1/K"},
    {"imu1.q_AI_slope.y", "rad/K"},
    {"cam0.q_CI_slope.z", "rad/K"},
    {"cam0.p_CI_slope.x", "m/K"},
    {"cam0.focal_slope.y", "px/K"},
    {"cam0.principal_slope.x", "px/K"},
    {"cam0.distortion_slope.w", "1/K"},
    {"cam0.time_offset_slope", "s/K"},
};

TEST_F(CalibrationServiceTest, EveryBlockThatDiffersIsComparedInItsUnit) {
  Rig rig = TestRig("all");
  EstimateEveryBlock(&rig);
  const auto created = domain_->CreateRig(rig);
  ASSERT_TRUE(created.ok()) << created.status();
  const Eigen::VectorXd sigmas = ReferenceSigmas(rig);
  StoredCalibration a;
  a.rig = rig.id;
  a.version = 1;
  a.theta = rig.factory;
  a.covariance = sigmas.cwiseAbs2().asDiagonal();
  StoredCalibration b = a;
  b.version = 2;
  b.theta = BoxPlus(rig.factory, sigmas);
  const auto compared = Compare(store_.get(), a, b);
  ASSERT_TRUE(compared.ok()) << compared.status();
  std::map<std::string, v1::CompareCalibrationsResponse::Difference> by_name;
  for (const auto& one : compared->differences()) {
    by_name[one.component()] = one;
  }
  EXPECT_EQ(by_name.size(), FreeComponents(rig).size());
  EXPECT_EQ(compared->differences_size(), static_cast<int>(by_name.size()));
  const auto components = TangentComponents(rig.factory);
  for (std::size_t i = 0; i < components.size(); ++i) {
    ASSERT_TRUE(by_name.contains(components[i].name)) << components[i].name;
    const auto& one = by_name[components[i].name];
    const double sigma = sigmas(static_cast<Eigen::Index>(i));
    // Rounding: of a focal length, and of the inverse of a covariance.
    EXPECT_NEAR(one.difference(), sigma, 1e-9 * sigma) << one.component();
    EXPECT_NEAR(one.sigma(), std::sqrt(2) * sigma, 1e-6 * sigma)
        << one.component();
  }
  for (const auto& [name, unit] : kOptionalComponents) {
    EXPECT_EQ(by_name[name].unit(), unit) << name;
  }
}

TEST_F(CalibrationServiceTest, EveryWatcherGetsTheNewVersion) {
  AddRig();
  StoredCalibration next = *store_->GetActiveCalibration("r");
  next.version = 2;
  std::array<Context, 2> contexts;
  std::array<std::unique_ptr<grpc::ClientReader<v1::Calibration>>, 2> readers;
  v1::Calibration seen;
  for (int i = 0; i < 2; ++i) {
    readers[i] = Watch(&contexts[i], "rigs/r");
    ASSERT_TRUE(readers[i]->Read(&seen));
    EXPECT_EQ(seen.version(), 1);
  }
  pipeline_->Publish(next);
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(readers[i]->Read(&seen));
    EXPECT_EQ(seen.version(), 2);
    contexts[i].TryCancel();
    readers[i]->Finish();
  }
}

TEST_F(CalibrationServiceTest, SlowWatcherEndsUpWithTheNewest) {
  AddRig();
  StoredCalibration next = *store_->GetActiveCalibration("r");
  Context context;
  const auto reader = Watch(&context, "rigs/r");
  v1::Calibration seen;
  ASSERT_TRUE(reader->Read(&seen));
  for (next.version = 2; next.version <= 3000; ++next.version) {
    pipeline_->Publish(next);
  }
  std::int64_t before = 1;
  while (before < 3000 && reader->Read(&seen)) {
    EXPECT_GT(seen.version(), before);
    before = seen.version();
  }
  EXPECT_EQ(before, 3000);
  context.TryCancel();
  reader->Finish();
}

TEST_F(CalibrationServiceTest, WatchOfAnUnknownRigIsRefused) {
  v1::Calibration seen;
  Context unknown;
  const auto reader = Watch(&unknown, "rigs/r");
  EXPECT_FALSE(reader->Read(&seen));
  ExpectNotFound(reader->Finish(), "rigs/r");
  Context malformed;
  EXPECT_THAT(BadFields(Watch(&malformed, "r")->Finish()),
              ElementsAre("parent"));
}

}  // namespace
}  // namespace selfcal::server
