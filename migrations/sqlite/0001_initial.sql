-- Everything that selfcald keeps. Times are nanoseconds since the Unix epoch
-- unless a comment says otherwise. A column sha256 is the checksum of the blob
-- beside it, verified whenever the blob is read. Blobs are messages of
-- server/store/records.proto.

CREATE TABLE rigs (
  rig INTEGER PRIMARY KEY,
  id TEXT NOT NULL UNIQUE,
  create_time_ns INTEGER NOT NULL,
  definition BLOB NOT NULL,  -- RigRecord
  sha256 BLOB NOT NULL
) STRICT;

-- Metadata of every segment ever received.
CREATE TABLE segments (
  segment INTEGER PRIMARY KEY,  -- order of arrival over all rigs
  rig INTEGER NOT NULL REFERENCES rigs,
  session TEXT NOT NULL,
  session_index INTEGER NOT NULL,
  sequence INTEGER NOT NULL,  -- order of arrival in the rig, from 1
  state INTEGER NOT NULL CHECK (state IN (1, 2, 3)),  -- stored scored unusable
  problem TEXT NOT NULL DEFAULT '',
  receive_time_ns INTEGER NOT NULL,
  calibration_version INTEGER NOT NULL,
  start_ns INTEGER NOT NULL,  -- clock of the session
  end_ns INTEGER NOT NULL,    -- clock of the session
  keyframes INTEGER NOT NULL,
  imu_samples INTEGER NOT NULL,
  landmarks INTEGER NOT NULL,
  observations INTEGER NOT NULL,
  UNIQUE (rig, session, session_index),
  UNIQUE (rig, sequence)
) STRICT;

-- The queue of the scoring workers.
CREATE INDEX unscored_segments ON segments (segment) WHERE state = 1;

-- Data of a segment: while it waits for its score, and while a table or an
-- unfinished run references it.
CREATE TABLE payloads (
  segment INTEGER PRIMARY KEY REFERENCES segments,
  rig INTEGER NOT NULL REFERENCES rigs,
  data BLOB NOT NULL,  -- zstd frame of a selfcal.v1.MotionSegment
  raw_bytes INTEGER NOT NULL,  -- before compression
  sha256 BLOB NOT NULL  -- of data
) STRICT;

CREATE INDEX payloads_of_rig ON payloads (rig);

-- What a scored segment says about theta; kept for ever.
CREATE TABLE segment_information (
  segment INTEGER PRIMARY KEY REFERENCES segments,
  information BLOB NOT NULL,  -- SegmentInformationRecord
  sha256 BLOB NOT NULL
) STRICT;

-- The part of it that is listed and sorted, in nats.
CREATE TABLE segment_scores (
  segment INTEGER NOT NULL REFERENCES segments,
  group_name TEXT NOT NULL,
  entropy REAL,  -- NULL: not a number
  gain REAL,
  rank INTEGER NOT NULL,
  PRIMARY KEY (segment, group_name)
) STRICT, WITHOUT ROWID;

-- One table for each group of a rig.
CREATE TABLE tables (
  rig INTEGER NOT NULL REFERENCES rigs,
  group_name TEXT NOT NULL,
  position INTEGER NOT NULL,  -- of the group in the rig
  capacity INTEGER NOT NULL,
  scored INTEGER NOT NULL,  -- segments that were offered
  PRIMARY KEY (rig, group_name)
) STRICT, WITHOUT ROWID;

CREATE TABLE table_entries (
  rig INTEGER NOT NULL,
  group_name TEXT NOT NULL,
  segment INTEGER NOT NULL REFERENCES segments,
  entropy REAL NOT NULL,
  gain REAL NOT NULL,
  PRIMARY KEY (rig, group_name, segment),
  FOREIGN KEY (rig, group_name) REFERENCES tables
) STRICT, WITHOUT ROWID;

CREATE INDEX entries_of_segment ON table_entries (segment);

CREATE TABLE runs (
  rig INTEGER NOT NULL REFERENCES rigs,
  run INTEGER NOT NULL,  -- counts from 1 in a rig
  -- pending running succeeded failed cancelled
  state INTEGER NOT NULL CHECK (state IN (1, 2, 3, 4, 5)),
  -- tables full, tables changed, manual
  cause INTEGER NOT NULL CHECK (cause IN (1, 2, 3)),
  create_time_ns INTEGER NOT NULL,
  end_time_ns INTEGER NOT NULL DEFAULT 0,
  base_version INTEGER NOT NULL,
  attempts INTEGER NOT NULL DEFAULT 0,
  calibration_version INTEGER NOT NULL DEFAULT 0,
  message TEXT NOT NULL DEFAULT '',
  PRIMARY KEY (rig, run)
) STRICT, WITHOUT ROWID;

CREATE UNIQUE INDEX one_unfinished_run ON runs (rig) WHERE state IN (1, 2);

-- The snapshot of the tables that a run works on.
CREATE TABLE run_segments (
  rig INTEGER NOT NULL,
  run INTEGER NOT NULL,
  segment INTEGER NOT NULL REFERENCES segments,
  PRIMARY KEY (rig, run, segment),
  FOREIGN KEY (rig, run) REFERENCES runs
) STRICT, WITHOUT ROWID;

CREATE INDEX runs_of_segment ON run_segments (segment);

-- Versions of a calibration: append-only, but for the state.
CREATE TABLE calibrations (
  rig INTEGER NOT NULL REFERENCES rigs,
  version INTEGER NOT NULL CHECK (version >= 1),  -- the factory's is 1
  state INTEGER NOT NULL CHECK (state IN (1, 2, 3)),  -- active superseded rejected
  create_time_ns INTEGER NOT NULL,
  run INTEGER,  -- that produced it
  content BLOB NOT NULL,  -- CalibrationRecord
  sha256 BLOB NOT NULL,
  PRIMARY KEY (rig, version),
  FOREIGN KEY (rig, run) REFERENCES runs
) STRICT, WITHOUT ROWID;

CREATE UNIQUE INDEX one_active_calibration ON calibrations (rig)
  WHERE state = 1;

CREATE TRIGGER calibrations_never_change
BEFORE UPDATE OF rig, version, create_time_ns, run, content, sha256
ON calibrations
BEGIN
  SELECT RAISE(ABORT, 'a calibration version never changes');
END;

CREATE TRIGGER rejected_calibrations_stay_rejected
BEFORE UPDATE OF state ON calibrations
WHEN (OLD.state = 3) <> (NEW.state = 3)
BEGIN
  SELECT RAISE(ABORT, 'a calibration is rejected once and for all');
END;

CREATE TRIGGER calibrations_stay
BEFORE DELETE ON calibrations
BEGIN
  SELECT RAISE(ABORT, 'a calibration version is never deleted');
END;

-- Which segments a version came from.
CREATE TABLE calibration_segments (
  rig INTEGER NOT NULL,
  version INTEGER NOT NULL,
  segment INTEGER NOT NULL REFERENCES segments,
  PRIMARY KEY (rig, version, segment),
  FOREIGN KEY (rig, version) REFERENCES calibrations
) STRICT, WITHOUT ROWID;

CREATE TRIGGER calibration_segments_never_change
BEFORE UPDATE ON calibration_segments
BEGIN
  SELECT RAISE(ABORT, 'the origin of a calibration never changes');
END;

CREATE TRIGGER calibration_segments_stay
BEFORE DELETE ON calibration_segments
BEGIN
  SELECT RAISE(ABORT, 'the origin of a calibration is never deleted');
END;

-- What happened, one row each.
CREATE TABLE events (
  event INTEGER PRIMARY KEY AUTOINCREMENT,
  time_ns INTEGER NOT NULL,
  rig TEXT NOT NULL,
  kind INTEGER NOT NULL CHECK (kind BETWEEN 1 AND 6),
  detail TEXT NOT NULL
) STRICT;

CREATE TRIGGER events_never_change
BEFORE UPDATE ON events
BEGIN
  SELECT RAISE(ABORT, 'an event never changes');
END;

CREATE TRIGGER events_stay
BEFORE DELETE ON events
BEGIN
  SELECT RAISE(ABORT, 'an event is never deleted');
END;
