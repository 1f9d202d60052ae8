#include "core/calibration/map_sharing.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>
#include <tuple>
#include <utility>

#include "core/calibration/partition.h"

namespace selfcal {
namespace {

// Observations [begin, end) of a track.
struct Piece {
  int begin = 0;
  int end = 0;
  int chain = 0;
};

std::vector<Piece> FindPieces(const SharingLimits& limits,
                              std::span<const int> chain_starts,
                              const Track& track) {
  std::vector<Piece> pieces;
  const std::vector<TrackObservation>& seen = track.observations;
  for (int i = 0; i < static_cast<int>(seen.size()); ++i) {
    const int keyframe = seen[i].keyframe;
    if (!pieces.empty()) {
      Piece& last = pieces.back();
      const bool same_chain =
          last.chain + 1 == static_cast<int>(chain_starts.size()) ||
          keyframe < chain_starts[last.chain + 1];
      if (same_chain &&
          keyframe - seen[last.end - 1].keyframe <= limits.max_lost &&
          keyframe - seen[last.begin].keyframe < limits.max_length) {
        last.end = i + 1;
        continue;
      }
    }
    const auto next =
        std::upper_bound(chain_starts.begin(), chain_starts.end(), keyframe);
    pieces.push_back(
        {i, i + 1, static_cast<int>(next - chain_starts.begin()) - 1});
  }
  return pieces;
}

// A landmark with more than one piece.
struct Connection {
  int track = 0;
  bool with_depth = false;
  std::vector<Piece> pieces;
  std::vector<bool> kept = {};  // for each piece, whether it is connected
};

// Keeps connections within the limits, the best ones first.
void KeepWithinLimits(const SharingLimits& limits,
                      int chains,
                      std::vector<Connection>* connections) {
  std::vector<Connection*> order;
  for (Connection& connection : *connections) order.push_back(&connection);
  const auto rank = [](const Connection* connection) {
    const std::vector<Piece>& pieces = connection->pieces;
    return std::tuple(!connection->with_depth,
                      -static_cast<int>(pieces.size()),
                      -pieces.back().end,
                      connection->track);
  };
  std::sort(order.begin(),
            order.end(),
            [&](const Connection* a, const Connection* b) {
              return rank(a) < rank(b);
            });
  std::vector<int> room(chains, limits.of_chain);
  int in_all = limits.of_partition;
  for (Connection* connection : order) {
    const std::vector<Piece>& pieces = connection->pieces;
    int kept = 0;
    for (const Piece& piece : pieces) {
      const bool fits = in_all > 0 && room[piece.chain] > 0;
      connection->kept.push_back(fits);
      kept += fits ? 1 : 0;
    }
    if (kept < 2) {
      connection->kept.assign(pieces.size(), false);
      continue;
    }
    --in_all;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      const bool counted = i > 0 && pieces[i - 1].chain == pieces[i].chain;
      if (connection->kept[i] && !counted) --room[pieces[i].chain];
    }
  }
}

// Sets of chains that are connected by the kept connections.
std::vector<std::vector<int>> Connected(
    const std::vector<int>& chains,
    int merge_landmarks,
    const std::vector<Track>& tracks,
    const std::vector<Connection>& connections) {
  std::map<int, Observers> by_chain;
  for (const int chain : chains) by_chain[chain].members = {chain};
  for (const Connection& connection : connections) {
    if (!connection.with_depth) continue;
    for (std::size_t i = 0; i < connection.pieces.size(); ++i) {
      if (!connection.kept[i]) continue;
      std::vector<std::uint64_t>& ids =
          by_chain[connection.pieces[i].chain].landmarks;
      // Tracks are sorted by id.
      const std::uint64_t id = tracks[connection.track].id;
      if (ids.empty() || ids.back() != id) ids.push_back(id);
    }
  }
  std::vector<Observers> sets;
  for (auto& [chain, observers] : by_chain) {
    sets.push_back(std::move(observers));
  }
  MergeObservers(merge_landmarks, &sets);
  std::vector<std::vector<int>> connected;
  for (Observers& set : sets) {
    std::sort(set.members.begin(), set.members.end());
    connected.push_back(std::move(set.members));
  }
  std::sort(connected.begin(), connected.end());
  return connected;
}

Track PartOf(const Track& whole, std::span<const Piece> pieces) {
  Track part{.id = whole.id};
  for (const Piece& piece : pieces) {
    if (!part.observations.empty()) {
      part.later_pieces.push_back(static_cast<int>(part.observations.size()));
    }
    part.observations.insert(part.observations.end(),
                             whole.observations.begin() + piece.begin,
                             whole.observations.begin() + piece.end);
  }
  return part;
}

// Splits a track: the kept pieces of each set of connected chains form one
// track, all other pieces one track each.
void Split(const Track& whole,
           const Connection& connection,
           const std::map<int, int>& set_of_chain,
           std::vector<Track>* tracks) {
  std::map<int, std::vector<Piece>> kept;
  std::vector<Track> parts;
  for (std::size_t i = 0; i < connection.pieces.size(); ++i) {
    const Piece& piece = connection.pieces[i];
    if (connection.kept[i]) {
      kept[set_of_chain.at(piece.chain)].push_back(piece);
    } else {
      parts.push_back(PartOf(whole, std::span(&piece, 1)));
    }
  }
  for (const auto& [set, pieces] : kept) {
    parts.push_back(PartOf(whole, pieces));
  }
  std::sort(parts.begin(), parts.end(), [](const Track& a, const Track& b) {
    return a.observations.front().keyframe < b.observations.front().keyframe;
  });
  std::move(parts.begin(), parts.end(), std::back_inserter(*tracks));
}

}  // namespace

SharedMap ShareMap(const SharingLimits& limits,
                   int merge_landmarks,
                   std::span<const int> chain_starts,
                   const std::vector<int>& chains,
                   std::vector<Track> tracks,
                   const std::vector<bool>& with_depth) {
  std::vector<Connection> connections;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    std::vector<Piece> pieces = FindPieces(limits, chain_starts, tracks[t]);
    if (pieces.size() < 2) continue;
    connections.push_back(
        {static_cast<int>(t), with_depth[t], std::move(pieces)});
  }
  KeepWithinLimits(limits, static_cast<int>(chain_starts.size()), &connections);
  SharedMap result{{}, Connected(chains, merge_landmarks, tracks, connections)};
  std::map<int, int> set_of_chain;
  for (std::size_t s = 0; s < result.connected.size(); ++s) {
    for (const int chain : result.connected[s]) {
      set_of_chain[chain] = static_cast<int>(s);
    }
  }
  auto next = connections.begin();
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    if (next == connections.end() || next->track != static_cast<int>(t)) {
      result.tracks.push_back(std::move(tracks[t]));
    } else {
      Split(tracks[t], *next++, set_of_chain, &result.tracks);
    }
  }
  return result;
}

}  // namespace selfcal
