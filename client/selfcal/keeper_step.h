// The decision of the keeper: what it does next, from the state of the queue
// and of the spool. A plain function over values.
//
// Segments are sent in the order in which they were accepted, so that one goes
// into the window only after all segments on disk that are older.
#pragma once

namespace selfcal::client {

enum class KeeperStep {
  kWait,         // for a change of the queue, or the end of a block
  kRemoveFiles,  // of acknowledged segments
  kEncode,       // the oldest incoming segment
  kAppend,       // the encoded segment to the window
  kSpool,        // the encoded segment to disk
  kLoad,         // the oldest unloaded segment on disk, into the window
};

struct KeeperSituation {
  bool has_finished_files = false;  // of acknowledged segments
  bool has_incoming = false;        // segments that are not encoded
  bool has_encoded = false;         // the keeper holds an encoded segment
  bool window_is_empty = true;
  bool window_has_room = true;
  bool memory_has_room = true;   // for one more segment
  bool has_unloaded = false;     // segments on disk that are not in the window
  bool spool_is_usable = false;  // there is one, and it is not blocked
};

// Files are removed first, as that frees the disk.
KeeperStep NextStep(const KeeperSituation& now);

}  // namespace selfcal::client
