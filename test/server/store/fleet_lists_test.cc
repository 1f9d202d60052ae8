// Lists over all rigs: by time, page by page.
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "core/model/calibration.h"
#include "test/server/store/store_test.h"
#include "test/server/test_records.h"

namespace selfcal::server {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::SizeIs;

class FleetListsTest : public StoreTest {
 protected:
  static constexpr std::int64_t kTime = 1'700'000'000'000'000'000;

  // A run of the rig at this time, with its version.
  void Run(const std::string& id, std::int64_t time) {
    now_ns_ = kTime + time;
    const Rig rig = TestRig(id);
    if (!store_->GetRig(id).ok()) {
      ASSERT_TRUE(domain_->CreateRig(rig).ok());
      Put(id, 0);
      Score(rig, 0, 1.0);
    }
    const auto run = domain_->CreateManualRun(id, true);
    ASSERT_TRUE(run.ok()) << run.status();
    Finish(id, run->run);
  }

  void Finish(const std::string& id, std::int64_t run) {
    ASSERT_TRUE(domain_->BeginRun(id, run).ok());
    StoredCalibration found =
        TestCalibration(TestRig(id), *store_->GetRun(id, run));
    found.report = CalibrationResult();
    found.report->final_cost = 10.0 * run + id.front();
    found.report->segment_fits.resize(2);
    const auto finished = domain_->FinishRun(id, run, found);
    ASSERT_TRUE(finished.ok()) << finished.status();
  }

  void SetLabel(const std::string& id,
                const std::string& name,
                const std::string& value) {
    const auto updated = domain_->UpdateRig(
        id,
        [&](StoredRig rig) -> absl::StatusOr<StoredRig> {
          rig.labels[name] = value;
          return rig;
        },
        "eve");
    ASSERT_TRUE(updated.ok()) << updated.status();
  }

  template <typename Fetch, typename Text>
  static std::vector<std::string> Pages(const Fetch& fetch, const Text& text) {
    std::vector<std::string> all;
    Page page{2, ""};
    do {
      const auto listed = fetch(page);
      EXPECT_TRUE(listed.ok()) << listed.status();
      if (!listed.ok()) return all;
      for (const auto& item : listed->items) all.push_back(text(item));
      page.token = listed->next_token;
    } while (!page.token.empty());
    return all;
  }
};
SELFCAL_STORE_TEST_SUITE(FleetListsTest);

TEST_P(FleetListsTest, RunsAndVersionsOfAllRigsGoByTime) {
  Run("b", 1);
  Run("a", 2);
  Run("c", 3);
  Run("a", 4);
  Run("b", 4);  // at the same time
  const auto runs = Pages(
      [&](const Page& page) { return store_->ListRuns("", page); },
      [](const StoredRun& run) { return run.rig + std::to_string(run.run); });
  ASSERT_THAT(runs, SizeIs(5));
  EXPECT_THAT(std::vector<std::string>(runs.begin(), runs.begin() + 2),
              ::testing::UnorderedElementsAre("a2", "b2"));
  EXPECT_THAT(std::vector<std::string>(runs.begin() + 2, runs.end()),
              ElementsAre("c1", "a1", "b1"));
  const auto versions = Pages(
      [&](const Page& page) { return store_->ListCalibrations("", page); },
      [](const StoredCalibration& version) {
        return version.rig + std::to_string(version.version);
      });
  // With the factory's version of each rig, at the time of its first run.
  ASSERT_THAT(versions, SizeIs(8));
  EXPECT_THAT(std::vector<std::string>(versions.begin() + 2, versions.end()),
              ElementsAre("c2", "c1", "a2", "a1", "b2", "b1"));
}

TEST_P(FleetListsTest, ParametersGoByRigAndVersion) {
  Run("a", 1);
  Run("b", 2);
  Run("a", 3);
  const auto all = [&](const EstimateQuery& query) {
    return Pages(
        [&](const Page& page) { return store_->ListEstimates(query, page); },
        [](const StoredEstimate& estimate) {
          return estimate.rig + std::to_string(estimate.version) + " " +
                 estimate.component;
        });
  };
  const auto components = TangentComponents(TestRig("a").factory);
  EXPECT_THAT(all({}), SizeIs(5 * components.size()));
  EstimateQuery query;
  query.component = components[3].name;
  query.rigs.name = "a";
  EXPECT_THAT(all(query),
              ElementsAre("a1 " + query.component,
                          "a2 " + query.component,
                          "a3 " + query.component));
  query.only_active = true;
  query.rigs.name = "";
  EXPECT_THAT(all(query),
              ::testing::UnorderedElementsAre("a3 " + query.component,
                                              "b2 " + query.component));
  query.rigs.labels = {{"model", "t4"}};
  EXPECT_THAT(all(query), SizeIs(0));
  SetLabel("b", "model", "t4");
  EXPECT_THAT(all(query), ElementsAre("b2 " + query.component));
}

TEST_P(FleetListsTest, ParametersAreThoseOfTheVersion) {
  Run("a", 1);
  const auto active = store_->GetActiveCalibration("a");
  ASSERT_TRUE(active.ok()) << active.status();
  EstimateQuery query;
  query.only_active = true;
  const auto listed = store_->ListEstimates(query, {100, ""});
  ASSERT_TRUE(listed.ok()) << listed.status();
  const auto components = TangentComponents(active->theta);
  const Eigen::VectorXd values = ReadableValues(active->theta);
  ASSERT_THAT(listed->items, SizeIs(components.size()));
  for (const StoredEstimate& estimate : listed->items) {
    const auto found = std::find_if(
        components.begin(), components.end(), [&](const auto& component) {
          return component.name == estimate.component;
        });
    ASSERT_NE(found, components.end());
    const auto i = found - components.begin();
    EXPECT_EQ(estimate.value, values[i]);
    EXPECT_EQ(estimate.sigma, std::sqrt(active->covariance(i, i)));
    EXPECT_EQ(estimate.from_factory, 0.0);  // TestCalibration is the factory's
    EXPECT_EQ(estimate.unit, found->unit);
    EXPECT_EQ(estimate.state, CalibrationState::kActive);
  }
}

// Rigs of a label are read some at a time, until the page is full.
TEST_P(FleetListsTest, ParametersThatFewRigsOfALabelHaveAreAllFound) {
  for (int k = 0; k < 20; ++k) {
    Rig rig = TestRig("rig" + std::to_string(k));
    if (k % 6 == 0) rig.factory.cameras.push_back(rig.factory.cameras[0]);
    ASSERT_TRUE(domain_->CreateRig(rig).ok());
    SetLabel(rig.id, "model", k == 18 ? "t5" : "t4");
  }
  EstimateQuery query;
  query.component = "cam1.focal.x";
  query.rigs.labels = {{"model", "t4"}};
  const auto all = [&] {
    return Pages(
        [&](const Page& page) { return store_->ListEstimates(query, page); },
        [](const StoredEstimate& estimate) { return estimate.rig; });
  };
  EXPECT_THAT(all(), ::testing::UnorderedElementsAre("rig0", "rig6", "rig12"));
  query.component = "";
  EXPECT_THAT(all(),
              SizeIs(16 * TangentSize(TestRig("a").factory) +
                     3 * (TangentSize(TestRig("a").factory) +
                          CameraTangentSize(TestRig("a").factory.cameras[0]))));
  query.component = "cam2.focal.x";
  EXPECT_THAT(all(), SizeIs(0));
}

TEST_P(FleetListsTest, ParametersOfNoRigAreNotFound) {
  EstimateQuery query;
  query.rigs.name = "nobody";
  EXPECT_TRUE(absl::IsNotFound(store_->ListEstimates(query, {}).status()));
}

TEST_P(FleetListsTest, ATokenIsOfItsList) {
  Run("a", 1);
  Run("b", 2);
  const auto all = store_->ListRuns("", {1, ""});
  ASSERT_TRUE(all.ok()) << all.status();
  ASSERT_FALSE(all->next_token.empty());
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListRuns("a", {1, all->next_token}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListCalibrations("", {1, all->next_token}).status()));
  EXPECT_TRUE(
      absl::IsInvalidArgument(store_->ListRuns("", {1, "nonsense"}).status()));
}

TEST_P(FleetListsTest, SegmentsOfAllRigsGoByArrivalOrGain) {
  const auto add = [&](const std::string& id, int index, double gain) {
    now_ns_ += 1'000'000'000;
    Put(id, index);
    Score(TestRig(id), index, 1.0, gain);
  };
  for (const std::string id : {"b", "a", "c"}) {
    ASSERT_TRUE(domain_->CreateRig(TestRig(id)).ok());
  }
  add("b", 0, 2.0);
  add("a", 0, 4.0);
  add("c", 0, 3.0);
  add("a", 1, 1.0);
  const auto all = [&](const SegmentQuery& query, const RigQuery& of) {
    return Pages(
        [&](const Page& page) {
          return store_->ListSegments("", query, page, of);
        },
        [](const StoredSegment& segment) {
          return segment.rig + std::to_string(segment.key.index);
        });
  };
  EXPECT_THAT(all({}, {}), ElementsAre("a1", "c0", "a0", "b0"));
  SegmentQuery query;
  query.descending = false;
  EXPECT_THAT(all(query, {}), ElementsAre("b0", "a0", "c0", "a1"));
  query.order = SegmentQuery::Order::kGain;
  query.order_group = TestRig("a").groups[0].name;
  EXPECT_THAT(all(query, {}), ElementsAre("a1", "b0", "c0", "a0"));
  query.descending = true;
  EXPECT_THAT(all(query, {}), ElementsAre("a0", "c0", "b0", "a1"));
  query.scored_group = query.order_group;
  query.gain_nats.least = 2.5;
  EXPECT_THAT(all(query, {}), ElementsAre("a0", "c0"));

  RigQuery of;
  of.name = "a";
  EXPECT_THAT(all({}, of), ElementsAre("a1", "a0"));
  of.name = "";
  SetLabel("c", "model", "t4");
  of.labels = {{"model", "t4"}};
  EXPECT_THAT(all({}, of), ElementsAre("c0"));
  of.labels = {};
  of.choice = RigChoice{{"b"}, {{"model", "t4"}}};
  EXPECT_THAT(all({}, of), ElementsAre("c0", "b0"));
  EXPECT_THAT(all(query, of), ElementsAre("c0"));
  of.choice = RigChoice{};
  EXPECT_THAT(all({}, of), SizeIs(0));

  query.order = SegmentQuery::Order::kLandmarks;
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListSegments("", query, Page{}).status()));
  EXPECT_TRUE(store_->ListSegments("a", query, Page{}).ok());
}

TEST_P(FleetListsTest, SegmentsOfAllRigsGoByMotionAndTemperature) {
  using Order = SegmentQuery::Order;
  const auto add = [&](const std::string& id,
                       int index,
                       double scale,
                       std::optional<double> temperature_c) {
    MotionSegment segment = Segment(index);
    for (KeyframeState& x : segment.keyframes) x.v_GI *= scale;
    for (ImuSample& sample : segment.imu) sample.gyro *= 10 / scale;
    segment.temperature_c = temperature_c;
    ASSERT_TRUE(domain_->PutSegment(id, segment).ok());
  };
  for (const std::string id : {"b", "a", "c"}) {
    ASSERT_TRUE(domain_->CreateRig(TestRig(id)).ok());
  }
  add("b", 0, 2, 20);
  add("a", 0, 4, 10);
  add("c", 0, 3, {});
  add("a", 1, 1, 15);
  const auto all = [&](const SegmentQuery& query, const RigQuery& of = {}) {
    return Pages(
        [&](const Page& page) {
          return store_->ListSegments("", query, page, of);
        },
        [](const StoredSegment& segment) {
          return segment.rig + std::to_string(segment.key.index);
        });
  };
  SegmentQuery query;
  query.order = Order::kAcceleration;
  EXPECT_THAT(all(query), ElementsAre("a0", "c0", "b0", "a1"));
  query.descending = false;
  EXPECT_THAT(all(query), ElementsAre("a1", "b0", "c0", "a0"));
  const auto b = store_->GetSegment("b", {"s", 0});
  ASSERT_TRUE(b.ok()) << b.status();
  query.acceleration_mps2.least = b->motion->acceleration_mps2;
  EXPECT_THAT(all(query), ElementsAre("b0", "c0", "a0"));
  SetLabel("a", "model", "t4");
  RigQuery of;
  of.labels = {{"model", "t4"}};
  EXPECT_THAT(all(query, of), ElementsAre("a0"));

  query = {};
  query.order = Order::kAngularRate;
  EXPECT_THAT(all(query), ElementsAre("a1", "b0", "c0", "a0"));
  query.angular_rate_radps.most = b->motion->angular_rate_radps;
  EXPECT_THAT(all(query), ElementsAre("b0", "c0", "a0"));

  query = {};
  query.order = Order::kTemperature;
  EXPECT_THAT(all(query), ElementsAre("b0", "a1", "a0"));
  query.descending = false;
  EXPECT_THAT(all(query), ElementsAre("a0", "a1", "b0"));
}

TEST_P(FleetListsTest, SegmentsOfAllRigsAreFoundByStateAndCause) {
  for (const std::string id : {"a", "b"}) {
    ASSERT_TRUE(domain_->CreateRig(TestRig(id)).ok());
  }
  // The tables of both rigs hold all that are scored.
  for (int index = 0; index < 2; ++index) {
    for (const std::string id : {"b", "a"}) {
      now_ns_ += 1'000'000'000;
      Put(id, index);
      Score(TestRig(id), index, 1.0);
    }
  }
  now_ns_ += 1'000'000'000;
  Put("b", 2);
  Put("a", 2);
  for (const std::string id : {"a", "b"}) {
    ASSERT_TRUE(
        domain_->QuarantineSegments(id, "s", {}, "eve", "diverged").ok());
  }
  now_ns_ += 1'000'000'000;
  Put("b", 3);
  now_ns_ += 1'000'000'000;
  Put("a", 3);
  const auto all = [&](const SegmentQuery& query, const RigQuery& of = {}) {
    return Pages(
        [&](const Page& page) {
          return store_->ListSegments("", query, page, of);
        },
        [](const StoredSegment& segment) {
          return segment.rig + std::to_string(segment.key.index);
        });
  };
  SegmentQuery stored;
  stored.state = SegmentState::kStored;
  EXPECT_THAT(all(stored), ElementsAre("a3", "b3"));
  SegmentQuery unusable;
  unusable.state = SegmentState::kUnusable;
  EXPECT_THAT(all(unusable), SizeIs(6));
  // From all tables of the rig, and listed once. What no table held is not
  // excluded.
  SegmentQuery excluded;
  excluded.excluded = ExclusionCause::kUnusable;
  ASSERT_GT(store_->ListExclusions("a", {"s", 0})->size(), 1u);
  EXPECT_THAT(all(excluded), ElementsAre("a1", "b1", "a0", "b0"));
  excluded.state = SegmentState::kScored;
  EXPECT_THAT(all(excluded), SizeIs(0));
  excluded.state = SegmentState::kUnusable;
  excluded.descending = false;
  EXPECT_THAT(all(excluded), ElementsAre("b0", "a0", "b1", "a1"));
  excluded.excluded = ExclusionCause::kTooOld;
  EXPECT_THAT(all(excluded), SizeIs(0));

  SetLabel("b", "model", "t4");
  RigQuery of;
  of.labels = {{"model", "t4"}};
  excluded.excluded = ExclusionCause::kUnusable;
  EXPECT_THAT(all(excluded, of), ElementsAre("b0", "b1"));
  EXPECT_THAT(all(unusable, of), ElementsAre("b2", "b1", "b0"));
  EXPECT_THAT(all(stored, of), ElementsAre("b3"));

  const auto page = store_->ListSegments("", unusable, {1, ""});
  ASSERT_TRUE(page.ok()) << page.status();
  EXPECT_TRUE(absl::IsInvalidArgument(
      store_->ListSegments("", excluded, {1, page->next_token}).status()));
}

// Every list of many rigs has those that have one of the names or labels, and
// all conditions of a filter besides.
TEST_P(FleetListsTest, ListsAreLimitedToAChoiceOfRigs) {
  for (const std::string id : {"a", "b", "c", "d"}) Run(id, 1);
  SetLabel("b", "site", "north");
  SetLabel("c", "site", "south");
  SetLabel("d", "site", "north");
  SetLabel("d", "model", "t4");
  const auto rigs = [&](const RigQuery& of) {
    std::vector<std::set<std::string>> lists;
    const auto add = [&](const auto& fetch, const auto& text) {
      const auto names = Pages(fetch, text);
      lists.emplace_back(names.begin(), names.end());
    };
    const auto rig_of = [](const auto& item) { return item.rig; };
    add([&](const Page& page) { return store_->ListRuns("", page, of); },
        rig_of);
    add(
        [&](const Page& page) {
          return store_->ListCalibrations("", page, of);
        },
        rig_of);
    add(
        [&](const Page& page) {
          return store_->ListSegments("", {}, page, of);
        },
        rig_of);
    add([&](const Page& page) { return store_->ListEvents(page, "", of); },
        rig_of);
    add(
        [&](const Page& page) {
          return store_->ListNewestEvents(page, "", of);
        },
        rig_of);
    add(
        [&](const Page& page) {
          return store_->ListEstimates({of, "", false}, page);
        },
        rig_of);
    add([&](const Page& page) { return store_->ListRigSummaries(of, page); },
        rig_of);
    add([&](const Page& page) { return store_->ListRigs(of, page); },
        [](const StoredRig& stored) { return stored.rig.id; });
    return lists;
  };
  using Names = std::set<std::string>;
  EXPECT_THAT(rigs({}), Each(Names{"a", "b", "c", "d"}));
  RigQuery of;
  of.choice = RigChoice{{"a"}, {{"site", "north"}}};
  EXPECT_THAT(rigs(of), Each(Names{"a", "b", "d"}));
  of.labels = {{"model", "t4"}};
  EXPECT_THAT(rigs(of), Each(Names{"d"}));
  of.labels = {{"model", "t4"}, {"site", "south"}};
  EXPECT_THAT(rigs(of), Each(Names{}));
  of.labels = {};
  of.text = "c";
  EXPECT_THAT(rigs(of), Each(Names{}));
  of.choice = RigChoice{{"c"}, {}};
  EXPECT_THAT(rigs(of), Each(Names{"c"}));
  of = {};
  of.choice = RigChoice{};
  EXPECT_THAT(rigs(of), Each(Names{}));
}

TEST_P(FleetListsTest, DamagedVersionsDoNotHideOthers) {
  Run("a", 1);
  domain_.reset();
  store_.reset();
  ASSERT_TRUE(GetParam().damage(folder_, "calibrations", "content").ok());
  Reopen();
  Run("b", 2);
  const auto listed = store_->ListCalibrations("", {});
  ASSERT_TRUE(listed.ok()) << listed.status();
  for (const StoredCalibration& version : listed->items) {
    EXPECT_EQ(version.rig, "b");
  }
  EXPECT_THAT(listed->items, SizeIs(2));
  const auto several = store_->GetReports({{"a", 1}, {"b", 2}});
  ASSERT_TRUE(several.ok()) << several.status();
  ASSERT_THAT(*several, SizeIs(1));
  EXPECT_EQ(several->front().rig, "b");
}

TEST_P(FleetListsTest, RecordsOfSeveralRigsAreThoseOfEach) {
  for (const std::string id : {"a", "b", "c"}) {
    ASSERT_TRUE(domain_->CreateRig(TestRig(id)).ok());
    for (int index = 0; index < 3; ++index) {
      MotionSegment segment = Segment(index);
      segment.temperature_c = 20.0 + index + (id == "b" ? 10 : 0);
      ASSERT_TRUE(domain_->PutSegment(id, segment).ok());
      Score(TestRig(id), index, 1.0 + index);
    }
    SetLabel(id, "batch", id);
  }
  Finish("b", 1);  // full tables started it
  Finish("c", 1);
  Run("c", 3);

  const auto versions = store_->ListCalibrations("", {});
  ASSERT_TRUE(versions.ok()) << versions.status();
  EXPECT_THAT(versions->items, SizeIs(6));
  for (const StoredCalibration& version : versions->items) {
    const auto one = store_->GetCalibration(version.rig, version.version);
    ASSERT_TRUE(one.ok()) << one.status();
    EXPECT_EQ(version.theta.cameras.size(), one->theta.cameras.size());
    EXPECT_EQ(version.covariance, one->covariance);
    EXPECT_EQ(version.create_time_ns, one->create_time_ns);
    EXPECT_EQ(version.segments, one->segments);
    EXPECT_EQ(version.segments.size(), version.version == 1 ? 0u : 2u);
    ASSERT_EQ(version.temperatures.has_value(), version.version != 1);
    if (!version.temperatures) continue;
    EXPECT_EQ(version.temperatures->segments, 2);
    EXPECT_EQ(version.temperatures->min_c, version.rig == "b" ? 30 : 20);
    EXPECT_EQ(version.temperatures->max_c, version.rig == "b" ? 31 : 21);
    EXPECT_EQ(version.temperatures->mean_c, version.rig == "b" ? 30.5 : 20.5);
  }

  const auto reports = store_->GetReports(
      {{"c", 2}, {"nobody", 1}, {"b", 2}, {"a", 2}, {"a", 1}});
  ASSERT_TRUE(reports.ok()) << reports.status();
  EXPECT_THAT(*reports, SizeIs(3));
  for (const StoredCalibration& of : *reports) {
    const auto one = store_->GetCalibration(of.rig, of.version);
    ASSERT_TRUE(one.ok()) << one.status();
    EXPECT_EQ(of.seconds, one->seconds);
    ASSERT_EQ(of.report.has_value(), one->report.has_value());
    EXPECT_EQ(of.report.has_value(), of.rig != "a");
    if (!of.report) continue;
    EXPECT_EQ(of.report->final_cost, 10.0 + of.rig.front());
    EXPECT_THAT(of.report->segment_fits, SizeIs(2));
  }

  const auto runs = store_->ListRuns("", {});
  ASSERT_TRUE(runs.ok()) << runs.status();
  EXPECT_THAT(runs->items, SizeIs(4));
  for (const StoredRun& run : runs->items) {
    const auto one = store_->GetRun(run.rig, run.run);
    ASSERT_TRUE(one.ok()) << one.status();
    EXPECT_THAT(run.segments, SizeIs(2));
    EXPECT_EQ(run.segments, one->segments);
  }

  const auto rigs = store_->GetRigs({"a", "c", "nobody"});
  ASSERT_TRUE(rigs.ok()) << rigs.status();
  EXPECT_THAT(*rigs, SizeIs(2));
  for (const auto& [id, rig] : *rigs) {
    EXPECT_EQ(rig.rig.id, id);
    EXPECT_EQ(rig.labels.at("batch"), id);
  }

  const auto summaries = store_->ListRigSummaries({}, {});
  ASSERT_TRUE(summaries.ok()) << summaries.status();
  ASSERT_THAT(summaries->items, SizeIs(3));
  for (const RigSummary& summary : summaries->items) {
    const auto tables = store_->GetTables(summary.rig);
    ASSERT_TRUE(tables.ok()) << tables.status();
    ASSERT_EQ(summary.tables.size(), tables->size());
    for (std::size_t k = 0; k < tables->size(); ++k) {
      EXPECT_EQ(summary.tables[k].group, (*tables)[k].group);
      EXPECT_EQ(summary.tables[k].scored, 3);
      EXPECT_THAT(summary.tables[k].entries, SizeIs(2));
      EXPECT_EQ(summary.tables[k].entries[0].key, (*tables)[k].entries[0].key);
      EXPECT_EQ(summary.tables[k].entries[1].key, (*tables)[k].entries[1].key);
    }
    EXPECT_EQ(summary.labels.at("batch"), summary.rig);
    const int versions = summary.rig == "a" ? 1 : summary.rig == "b" ? 2 : 3;
    EXPECT_EQ(summary.active_version, versions);
    EXPECT_EQ(summary.newest_version, versions);
    EXPECT_EQ(summary.newest_run, summary.rig == "c" ? 2 : 1);
  }
}

}  // namespace
}  // namespace selfcal::server
