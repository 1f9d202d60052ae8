#include "test/evaluation/trust_kinds.h"

#include <iterator>

namespace selfcal {

const std::vector<TrustKind>& TrustKinds() {
  static const std::vector<TrustKind> all = [] {
    std::vector<TrustKind> kinds;
    for (auto part : {MotionKinds,
                      NoiseKinds,
                      CorruptionKinds,
                      ChangeKinds,
                      ModelKinds,
                      RecordedKinds}) {
      std::vector<TrustKind> some = part();
      kinds.insert(kinds.end(),
                   std::make_move_iterator(some.begin()),
                   std::make_move_iterator(some.end()));
    }
    return kinds;
  }();
  return all;
}

}  // namespace selfcal
