#include "test/core/preflight/mistakes.h"

#include <algorithm>
#include <utility>

namespace selfcal {

std::vector<Mistake> Mistakes() {
  std::vector<Mistake> all = ImuMistakes();
  for (Mistake& mistake : CameraMistakes()) all.push_back(std::move(mistake));
  return all;
}

void ForLandmarks(FedData* data,
                  const std::function<void(Eigen::Vector3d*)>& change) {
  for (MotionSegment& segment : data->segments) {
    for (Landmark& landmark : segment.landmarks) change(&landmark.p_G);
  }
}

std::vector<FindingKind> Kinds(const Diagnosis& diagnosis) {
  std::vector<FindingKind> kinds;
  for (const Finding& f : diagnosis.findings) kinds.push_back(f.kind);
  std::sort(kinds.begin(), kinds.end());
  kinds.erase(std::unique(kinds.begin(), kinds.end()), kinds.end());
  return kinds;
}

std::string Text(const Diagnosis& diagnosis) {
  std::string text;
  for (const Finding& f : diagnosis.findings) {
    text += "  " + std::string(FindingName(f.kind)) + ": " + f.cause +
            "\n    " + f.remedy + "\n";
  }
  for (const std::string& line : diagnosis.checked)
    text += "  + " + line + "\n";
  for (const std::string& line : diagnosis.not_checked) {
    text += "  - " + line + "\n";
  }
  return text;
}

}  // namespace selfcal
