#include "core/change/parameter_blocks.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "core/model/parameter_blocks.h"

namespace selfcal {
namespace {

ParameterBlock Components(std::string name,
                          std::vector<int> at,
                          Eigen::Index free) {
  const auto count = static_cast<Eigen::Index>(at.size());
  ParameterBlock block{
      std::move(name), Eigen::MatrixXd::Zero(free, count), std::move(at), 0};
  for (Eigen::Index k = 0; k < count; ++k) block.basis(block.at[k], k) = 1;
  return block;
}

// `stems` are those of the free components.
void SetShares(const std::vector<std::string>& stems,
               std::vector<ParameterBlock>* blocks) {
  const auto changes_by_itself = [&](const ParameterBlock& block) {
    return block.name.ends_with(".zoom") ||
           std::all_of(block.at.begin(), block.at.end(), [&](int k) {
             return stems[k].ends_with(".q_CI");
           });
  };
  const auto all = static_cast<double>(blocks->size());
  const auto likely = static_cast<double>(
      std::count_if(blocks->begin(), blocks->end(), changes_by_itself));
  const bool alike = likely == 0 || likely == all;
  for (ParameterBlock& block : *blocks) {
    block.share =
        alike ? 1 / all
              : 0.5 / (changes_by_itself(block) ? likely : all - likely);
  }
}

void AddUnlessKnown(ParameterBlock block, std::vector<ParameterBlock>* blocks) {
  const auto same = [&](const ParameterBlock& other) {
    return other.at == block.at && other.basis.cols() == block.basis.cols();
  };
  if (block.at.empty() || std::any_of(blocks->begin(), blocks->end(), same)) {
    return;
  }
  blocks->push_back(std::move(block));
}

}  // namespace

std::vector<ParameterBlock> GroupBlocks(const Rig& rig) {
  const std::vector<int> free = FreeComponents(rig);
  std::vector<ParameterBlock> blocks;
  for (const ParameterGroup& group : rig.groups) {
    std::vector<int> at;
    for (const int i : GroupComponents(rig, group)) {
      at.push_back(static_cast<int>(
          std::lower_bound(free.begin(), free.end(), i) - free.begin()));
    }
    blocks.push_back(Components(
        group.name, std::move(at), static_cast<Eigen::Index>(free.size())));
  }
  return blocks;
}

std::vector<ParameterBlock> ParameterBlocks(const Rig& rig) {
  const std::vector<int> free = FreeComponents(rig);
  const auto size = static_cast<Eigen::Index>(free.size());
  const Eigen::VectorXd prior = PriorSigmas(rig)(free);
  std::vector<int> all(free.size());
  std::iota(all.begin(), all.end(), 0);
  std::vector<ParameterBlock> blocks = {Components("all", all, size)};
  for (ParameterBlock& group : GroupBlocks(rig)) {
    AddUnlessKnown(std::move(group), &blocks);
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
    AddUnlessKnown(Components(stem, at, size), &blocks);
  }
  for (std::size_t c = 0; c < rig.factory.cameras.size(); ++c) {
    const std::string camera = "cam" + std::to_string(c);
    const auto focal = stems.find(camera + ".focal");
    if (focal == stems.end() || focal->second.size() != 2) continue;
    ParameterBlock zoom{
        camera + ".zoom", Eigen::MatrixXd::Zero(size, 1), focal->second, 0};
    for (int axis = 0; axis < 2; ++axis) {
      const int k = zoom.at[axis];
      zoom.basis(k, 0) = rig.factory.cameras[c].f(axis) / prior(k);
    }
    zoom.basis.normalize();
    AddUnlessKnown(std::move(zoom), &blocks);
  }
  SetShares(names, &blocks);
  return blocks;
}

}  // namespace selfcal
