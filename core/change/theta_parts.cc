#include "core/change/theta_parts.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "core/model/parameter_blocks.h"

namespace selfcal {
namespace {

ThetaPart Components(std::string name, std::vector<int> at, Eigen::Index free) {
  const auto count = static_cast<Eigen::Index>(at.size());
  ThetaPart part{
      std::move(name), Eigen::MatrixXd::Zero(free, count), std::move(at), 0};
  for (Eigen::Index k = 0; k < count; ++k) part.basis(part.at[k], k) = 1;
  return part;
}

// `stems` are those of the free components.
void SetShares(const std::vector<std::string>& stems,
               std::vector<ThetaPart>* parts) {
  const auto changes_by_itself = [&](const ThetaPart& part) {
    return part.name.ends_with(".zoom") ||
           std::all_of(part.at.begin(), part.at.end(), [&](int k) {
             return stems[k].ends_with(".q_CI");
           });
  };
  const auto all = static_cast<double>(parts->size());
  const auto likely = static_cast<double>(
      std::count_if(parts->begin(), parts->end(), changes_by_itself));
  const bool alike = likely == 0 || likely == all;
  for (ThetaPart& part : *parts) {
    part.share = alike
                     ? 1 / all
                     : 0.5 / (changes_by_itself(part) ? likely : all - likely);
  }
}

void AddUnlessKnown(ThetaPart part, std::vector<ThetaPart>* parts) {
  const auto same = [&](const ThetaPart& other) {
    return other.at == part.at && other.basis.cols() == part.basis.cols();
  };
  if (part.at.empty() || std::any_of(parts->begin(), parts->end(), same)) {
    return;
  }
  parts->push_back(std::move(part));
}

}  // namespace

std::vector<ThetaPart> GroupParts(const Rig& rig) {
  const std::vector<int> free = FreeComponents(rig);
  std::vector<ThetaPart> parts;
  for (const ParameterGroup& group : rig.groups) {
    std::vector<int> at;
    for (const int i : GroupComponents(rig, group)) {
      at.push_back(static_cast<int>(
          std::lower_bound(free.begin(), free.end(), i) - free.begin()));
    }
    parts.push_back(Components(
        group.name, std::move(at), static_cast<Eigen::Index>(free.size())));
  }
  return parts;
}

std::vector<ThetaPart> ThetaParts(const Rig& rig) {
  const std::vector<int> free = FreeComponents(rig);
  const auto size = static_cast<Eigen::Index>(free.size());
  const Eigen::VectorXd prior = PriorSigmas(rig)(free);
  std::vector<int> all(free.size());
  std::iota(all.begin(), all.end(), 0);
  std::vector<ThetaPart> parts = {Components("all", all, size)};
  for (ThetaPart& group : GroupParts(rig)) {
    AddUnlessKnown(std::move(group), &parts);
  }
  const std::vector<std::string> component_blocks =
      ComponentBlocks(rig.factory);
  std::vector<std::string> names;
  std::map<std::string, std::vector<int>> stems;
  for (std::size_t k = 0; k < free.size(); ++k) {
    names.push_back(component_blocks[free[k]]);
    stems[names.back()].push_back(static_cast<int>(k));
  }
  for (auto& [stem, at] : stems) {
    AddUnlessKnown(Components(stem, at, size), &parts);
  }
  for (std::size_t c = 0; c < rig.factory.cameras.size(); ++c) {
    const std::string camera = "cam" + std::to_string(c);
    const auto focal = stems.find(camera + ".focal");
    if (focal == stems.end() || focal->second.size() != 2) continue;
    ThetaPart zoom{
        camera + ".zoom", Eigen::MatrixXd::Zero(size, 1), focal->second, 0};
    for (int axis = 0; axis < 2; ++axis) {
      const int k = zoom.at[axis];
      zoom.basis(k, 0) = rig.factory.cameras[c].f(axis) / prior(k);
    }
    zoom.basis.normalize();
    AddUnlessKnown(std::move(zoom), &parts);
  }
  SetShares(names, &parts);
  return parts;
}

}  // namespace selfcal
