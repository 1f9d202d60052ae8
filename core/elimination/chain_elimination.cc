#include "core/elimination/chain_elimination.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "core/elimination/chain_places.h"
#include "core/elimination/chain_steps.h"

namespace selfcal {

using namespace chain;

void ChainElimination::Start(const ChainShape& shape, Record record) {
  structure_.Find(shape.keyframes, shape.tracks, shape.track_keyframes);
  if (shape.max_bytes > 0 && structure_.Bytes() > shape.max_bytes) {
    throw std::length_error(
        "tracks connect " + std::to_string(structure_.max_slots()) +
        " keyframes, which takes too much memory: send fewer keyframes in a "
        "segment");
  }
  layout_ = ChainLayout(shape);
  landmark_equations_.Start(shape, structure_, layout_);
  keyframe_equations_.Start(layout_, shape.keyframes);
  front_.Start(layout_, structure_);
  landmarks_.Start(shape, layout_);
  state_.Start(layout_, structure_);
  record_.Start(layout_, structure_, record == Record::kSteps);
  current_ = 0;
  begun_ = false;
}

void ChainElimination::TakeScratch(ChainElimination* finished) {
  std::swap(products_, finished->products_);
  keyframe_equations_.TakeMemory(&finished->keyframe_equations_);
  front_.TakeMemory(&finished->front_);
  landmarks_.TakeMemory(&finished->landmarks_);
  state_.TakeMemory(&finished->state_);
}

void ChainElimination::AddObservations(int keyframe,
                                       int camera,
                                       const double* rows,
                                       std::span<const int> observations,
                                       const PoseRotation* by_rotation) {
  const RowProducts products = products_.Add(
      width_, camera, rows, observations, by_rotation, &landmark_equations_);
  keyframe_equations_.Add(
      keyframe, landmark_equations_.camera(camera), products, by_rotation);
}

void ChainElimination::AddLandmarkPrior(int landmark,
                                        const Eigen::Matrix3d& H,
                                        const Eigen::Vector3d& g) {
  landmark_equations_.AddPrior(landmark, H, g);
}

void ChainElimination::BeginKeyframe() {
  if (begun_) return;
  begun_ = true;
  front_.OpenSlots(static_cast<int>(structure_.Poses(current_).size()));
  keyframe_equations_.AddKeyframeTo(&front_, current_);
  landmarks_.Eliminate(
      structure_, current_, record_.wanted(), &landmark_equations_, &front_);
  front_.SwapPoses(structure_.SwapWithNext(current_));
}

void ChainElimination::AddPrior(const ChainStateMatrix& information) {
  BeginKeyframe();
  const int pose = front_.Pose(0), motion = layout_.motion_place();
  for (int i = 0; i < kPose; ++i) {
    for (int j = 0; j <= i; ++j)
      front_(pose + i, pose + j) += information(i, j);
    for (int j = 0; j < layout_.motion_size; ++j) {
      front_(pose + i, motion + j) += information(i, kPose + j);
    }
  }
  for (int i = 0; i < layout_.motion_size; ++i) {
    for (int j = 0; j <= i; ++j) {
      front_(motion + i, motion + j) += information(kPose + i, kPose + j);
    }
  }
}

void ChainElimination::AddKeptBias(int kept, const KeptBiasRows& rows) {
  BeginKeyframe();
  for (int m = 0; m < rows.residual.size(); ++m) {
    const int bias = layout_.motion_place() + 3 + m;
    const int place = layout_.kept_place + kept + m;
    const double a = rows.by_bias[m], b = rows.by_kept[m];
    front_(bias, bias) += a * a;
    front_(place, bias) += a * b;
    front_(place, place) += b * b;
    front_(layout_.constant, bias) += a * rows.residual[m];
    front_(layout_.constant, place) += b * rows.residual[m];
  }
}

void ChainElimination::AddKeptState(int kept,
                                    const ChainStateVector& information) {
  BeginKeyframe();
  for (int m = 0; m < information.size(); ++m) {
    const int state =
        m < kPose ? front_.Pose(0) + m : layout_.motion_place() + m - kPose;
    const int place = layout_.kept_place + kept + m;
    front_(state, state) += information[m];
    front_(place, place) += information[m];
    front_(std::max(state, place), std::min(state, place)) -= information[m];
  }
}

void ChainElimination::Advance(const ChainTransition& link) {
  BeginKeyframe();
  record_.Add(state_.ByLink(link, &front_), &link);
  ++current_;
  begun_ = false;
}

void ChainElimination::Finish(SharedInformation* result) {
  BeginKeyframe();
  record_.Add(state_.ByItself(&front_), nullptr);
  // The products among camera parameters were summed separately.
  keyframe_equations_.AddSharedTo(&front_);
  const int size = shared_size();
  result->Lambda.resize(size, size);
  result->eta.resize(size);
  result->constant = front_(layout_.constant, layout_.constant);
  for (int j = 0; j < size; ++j) {
    for (int i = j; i < size; ++i) {
      const int a = layout_.Place(i), b = layout_.Place(j);
      const double information = front_(std::max(a, b), std::min(a, b));
      result->Lambda(i, j) = information;
      result->Lambda(j, i) = information;
    }
    result->eta(j) = -front_(layout_.constant, layout_.Place(j));
  }
}

void ChainElimination::FindSteps(
    const Eigen::VectorXd& shared,
    std::vector<ChainStateVector>* states,
    std::vector<Eigen::Vector3d>* landmarks) const {
  const Eigen::VectorXd z = SharedInPlaces(Recorded(), shared);
  FindStateSteps(Recorded(), z, states);
  landmarks_.FindSteps(landmark_equations_, z, *states, landmarks);
}

void ChainElimination::FindPosterior(
    const Eigen::VectorXd& shared,
    const Eigen::MatrixXd& shared_covariance,
    const std::vector<ChainStateVector>& states,
    ChainPosterior* posterior) const {
  FindChainPosterior(
      Recorded(), width_, shared, shared_covariance, states, posterior);
}

}  // namespace selfcal
