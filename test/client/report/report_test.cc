#include "client/report/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>
#include <stack>
#include <string>

#include "test/client/report/report_fixture.h"

namespace selfcal::client {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// Whether every element that opens is closed in its place.
bool IsBalanced(const std::string& html) {
  static const std::regex tag("<(/?)([a-z0-9]+)([^>]*)>");
  std::stack<std::string> open;
  for (std::sregex_iterator it(html.begin(), html.end(), tag), end; it != end;
       ++it) {
    const std::string name = (*it)[2];
    const std::string rest = (*it)[3];
    if (name == "meta" || (!rest.empty() && rest.back() == '/')) continue;
    if ((*it)[1].length() == 0) {
      open.push(name);
    } else if (open.empty() || open.top() != name) {
      return false;
    } else {
      open.pop();
    }
  }
  return open.empty();
}

TEST(Report, BeginsWithItsVerdict) {
  const std::string html = WriteReport(ADevice());
  EXPECT_THAT(html, HasSubstr("<h1>Calibration of device, version 2</h1>"));
  const auto verdict = html.find("Verdict: good.");
  ASSERT_NE(verdict, std::string::npos);
  EXPECT_LT(verdict, html.find("id=\"parameters\""));
}

TEST(Report, ShowsTheStoredVerdictWithItsSentences) {
  ReportData data = ADevice();
  v1::Verdict* verdict = data.calibration.mutable_verdict();
  verdict->set_kind(v1::Verdict::NOT_TRUSTWORTHY);
  verdict->set_text("not trustworthy");
  verdict->add_sentences("The solver stalled.");
  EXPECT_THAT(WriteReport(data),
              HasSubstr("<div class=\"verdict bad\"><p><strong>Verdict: not "
                        "trustworthy.</strong>"));
  EXPECT_THAT(WriteReport(data), HasSubstr("<li>The solver stalled.</li>"));
}

TEST(Report, ShowsRotationsInDegreesFromTheFactorys) {
  ReportData data = ADevice();
  for (v1::Calibration* version : {&data.calibration, &data.versions[1]}) {
    auto* rotation = version->mutable_estimates(0);
    rotation->set_component("cam0.q_CI.x");
    rotation->set_unit("rad");
    rotation->set_value(3.14);
    rotation->set_from_factory(version->version() == 1 ? 0 : 0.01);
    rotation->set_sigma(version->version() == 1 ? 0.1 : 0.001);
  }
  EXPECT_THAT(WriteReport(data),
              HasSubstr("<td>cam0.q_CI.x</td><td class=\"number\">0.573</td>"
                        "<td class=\"number\">0.057</td>"
                        "<td>deg from factory</td>"
                        "<td class=\"number\">5.7</td>"
                        "<td class=\"number\">4.61</td>"));
}

TEST(Report, HasChartsOfASecondImuIfTheDeviceHasOne) {
  ReportData data = ADevice();
  EXPECT_THAT(WriteReport(data), HasSubstr("IMU, rotation: root mean square"));
  EXPECT_THAT(WriteReport(data), Not(HasSubstr("second IMU, rotation")));
  for (v1::Segment& segment : data.segments) {
    segment.mutable_residuals()->add_imu1_inertial_rms(1.5);
  }
  EXPECT_THAT(WriteReport(data),
              HasSubstr("second IMU, rotation: root mean square [sigmas]"));
}

TEST(Report, IsOneFileOfBalancedHtml) {
  const std::string html = WriteReport(ADevice());
  EXPECT_TRUE(IsBalanced(html));
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("src=")));
  EXPECT_THAT(html, Not(HasSubstr("href=")));
  EXPECT_THAT(html, Not(HasSubstr("http:")));
  EXPECT_THAT(html, Not(HasSubstr("https:")));
}

TEST(Report, ShowsEachParameterWithBothSigmasAndWhatWasLearned) {
  const std::string html = WriteReport(ADevice());
  EXPECT_THAT(html,
              HasSubstr("<td>cam0.focal.x</td><td class=\"number\">0.247</td>"
                        "<td class=\"number\">0.01</td><td>px</td>"
                        "<td class=\"number\">1</td>"
                        "<td class=\"number\">4.61</td>"));
}

TEST(Report, SaysWhereItCameFromAndWhatWasChecked) {
  const std::string html = WriteReport(ADevice());
  EXPECT_THAT(html, HasSubstr("<td>started from</td><td>version 0</td>"));
  EXPECT_THAT(
      html,
      HasSubstr("<td>held-out segments</td><td>3 (0 rescored, "
                "0 not testable), 60 degrees: chi-square 58.0, of version "
                "0 0.0</td>"));
}

TEST(Report, MarksSegmentsThatItUsesAndThatTablesKeep) {
  const std::string html = WriteReport(ADevice());
  EXPECT_THAT(html, HasSubstr("<title>walk~0: 0.5</title>"));
  EXPECT_THAT(html, HasSubstr("<title>walk~2: -12.00 nat</title>"));
  EXPECT_THAT(html, HasSubstr("<td>walk~0</td>"));
  EXPECT_THAT(html, Not(HasSubstr("<td>walk~1</td>")));
}

TEST(Report, WhatADaemonSaysIsTextAndNothingElse) {
  ReportData data = ADevice();
  const std::string hostile = "<img src=x onerror='alert(1)'>\"&\x01";
  data.rig.set_name("rigs/" + hostile);
  data.calibration.mutable_estimates(0)->set_component(hostile);
  data.calibration.add_reasons(hostile);
  data.calibration.set_state(v1::Calibration::REJECTED);
  data.calibration.mutable_solver()->set_message(hostile);
  data.tables[0].set_name("rigs/device/tables/" + hostile);
  for (auto& segment : data.segments) {
    segment.set_name("rigs/device/segments/" + hostile);
    segment.mutable_scores(0)->set_group(hostile);
    segment.mutable_scores(0)->set_in_table(true);
  }
  data.calibration.mutable_provenance()->set_segments(0,
                                                      data.segments[0].name());
  const std::string html = WriteReport(data);
  EXPECT_THAT(html, Not(HasSubstr("<img")));
  EXPECT_THAT(html, HasSubstr("&lt;img src=x onerror=&#39;alert(1)&#39;&gt;"));
  EXPECT_TRUE(IsBalanced(html));
}

TEST(Report, OfADeviceWithoutAnythingIsStillAReport) {
  ReportData data;
  data.rig.set_name("rigs/new");
  data.calibration = AVersion(1, 1);
  data.versions = {data.calibration};
  const std::string html = WriteReport(data);
  EXPECT_THAT(html, HasSubstr("Verdict: factory."));
  EXPECT_TRUE(IsBalanced(html));
}

}  // namespace
}  // namespace selfcal::client
