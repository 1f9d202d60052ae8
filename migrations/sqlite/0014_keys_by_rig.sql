-- Every key begins with the rig: a segment is its rig and its sequence, and
-- activations and events are counted within their rig. The tables are written
-- anew before the old ones go, so that no reference is ever broken.

CREATE TABLE new_segments (
  rig INTEGER NOT NULL REFERENCES rigs,
  sequence INTEGER NOT NULL,  -- order of arrival in the rig, from 1
  session TEXT NOT NULL,
  session_index INTEGER NOT NULL,
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
  temperature_c REAL,  -- of the device; NULL: not known
  -- Root of what the squares of all whitened residuals keep, over their
  -- expectation; 0: not measured.
  fit REAL NOT NULL DEFAULT 0,
  -- Steady time of the arrival: the wall clock without its jumps.
  steady_ns INTEGER NOT NULL DEFAULT 0,
  PRIMARY KEY (rig, sequence),
  UNIQUE (rig, session, session_index)
) STRICT, WITHOUT ROWID;

INSERT INTO new_segments
  SELECT rig, sequence, session, session_index, state, problem,
    receive_time_ns, calibration_version, start_ns, end_ns, keyframes,
    imu_samples, landmarks, observations, temperature_c, fit, steady_ns
  FROM segments ORDER BY rig, sequence;

-- Tables with large rows keep their rowid.
CREATE TABLE new_payloads (
  rig INTEGER NOT NULL,
  sequence INTEGER NOT NULL,
  data BLOB NOT NULL,  -- zstd frame of a selfcal.v1.MotionSegment
  raw_bytes INTEGER NOT NULL,  -- before compression
  sha256 BLOB NOT NULL,  -- of data
  PRIMARY KEY (rig, sequence),
  FOREIGN KEY (rig, sequence) REFERENCES new_segments
) STRICT;

INSERT INTO new_payloads
  SELECT s.rig, s.sequence, p.data, p.raw_bytes, p.sha256
  FROM payloads p JOIN segments s ON s.segment = p.segment;

CREATE TABLE new_segment_information (
  rig INTEGER NOT NULL,
  sequence INTEGER NOT NULL,
  information BLOB NOT NULL,  -- SegmentInformationRecord
  sha256 BLOB NOT NULL,
  PRIMARY KEY (rig, sequence),
  FOREIGN KEY (rig, sequence) REFERENCES new_segments
) STRICT;

INSERT INTO new_segment_information
  SELECT s.rig, s.sequence, i.information, i.sha256
  FROM segment_information i JOIN segments s ON s.segment = i.segment;

CREATE TABLE new_segment_scores (
  rig INTEGER NOT NULL,
  sequence INTEGER NOT NULL,
  group_name TEXT NOT NULL,
  entropy REAL,  -- NULL: not a number
  gain REAL,
  rank INTEGER NOT NULL,
  PRIMARY KEY (rig, sequence, group_name),
  FOREIGN KEY (rig, sequence) REFERENCES new_segments
) STRICT, WITHOUT ROWID;

INSERT INTO new_segment_scores
  SELECT s.rig, s.sequence, c.group_name, c.entropy, c.gain, c.rank
  FROM segment_scores c JOIN segments s ON s.segment = c.segment;

CREATE TABLE new_segment_paths (
  rig INTEGER NOT NULL,
  sequence INTEGER NOT NULL,
  path BLOB NOT NULL,  -- SegmentPathRecord
  sha256 BLOB NOT NULL,
  PRIMARY KEY (rig, sequence),
  FOREIGN KEY (rig, sequence) REFERENCES new_segments
) STRICT, WITHOUT ROWID;

INSERT INTO new_segment_paths
  SELECT s.rig, s.sequence, p.path, p.sha256
  FROM segment_paths p JOIN segments s ON s.segment = p.segment;

CREATE TABLE new_segment_ends (
  rig INTEGER NOT NULL,
  sequence INTEGER NOT NULL,
  ends BLOB NOT NULL,  -- SegmentEndsRecord
  sha256 BLOB NOT NULL,
  PRIMARY KEY (rig, sequence),
  FOREIGN KEY (rig, sequence) REFERENCES new_segments
) STRICT;

INSERT INTO new_segment_ends
  SELECT s.rig, s.sequence, e.ends, e.sha256
  FROM segment_ends e JOIN segments s ON s.segment = e.segment;

CREATE TABLE new_table_entries (
  rig INTEGER NOT NULL,
  group_name TEXT NOT NULL,
  sequence INTEGER NOT NULL,
  entropy REAL NOT NULL,
  gain REAL NOT NULL,
  PRIMARY KEY (rig, group_name, sequence),
  FOREIGN KEY (rig, group_name) REFERENCES tables,
  FOREIGN KEY (rig, sequence) REFERENCES new_segments
) STRICT, WITHOUT ROWID;

INSERT INTO new_table_entries
  SELECT e.rig, e.group_name, s.sequence, e.entropy, e.gain
  FROM table_entries e JOIN segments s ON s.segment = e.segment;

CREATE TABLE new_table_absences (
  rig INTEGER NOT NULL,
  sequence INTEGER NOT NULL,
  group_name TEXT NOT NULL,
  -- insufficient gain, outranked, displaced, too old, device changed, data
  -- evicted, unusable, does not fit, many outliers
  cause INTEGER NOT NULL CHECK (cause >= 1),
  time_ns INTEGER NOT NULL,
  -- Sequence of the worst that was in the table, or of what took the place of
  -- this one; the segment may be gone since. NULL for other causes.
  rival INTEGER,
  rival_entropy REAL,
  -- The fit of a segment that does not fit, and the largest fit of those that
  -- do; NULL for other causes.
  fit REAL,
  fit_limit REAL,
  PRIMARY KEY (rig, sequence, group_name),
  FOREIGN KEY (rig, sequence) REFERENCES new_segments
) STRICT, WITHOUT ROWID;

INSERT INTO new_table_absences
  SELECT s.rig, s.sequence, a.group_name, a.cause, a.time_ns, r.sequence,
    a.rival_entropy, a.fit, a.fit_limit
  FROM table_absences a JOIN segments s ON s.segment = a.segment
  LEFT JOIN segments r ON r.segment = a.rival;

CREATE TABLE new_run_segments (
  rig INTEGER NOT NULL,
  run INTEGER NOT NULL,
  sequence INTEGER NOT NULL,
  -- 1: quarantined because of the result of the run, which does not use it.
  excluded INTEGER NOT NULL DEFAULT 0,
  PRIMARY KEY (rig, run, sequence),
  FOREIGN KEY (rig, run) REFERENCES runs,
  FOREIGN KEY (rig, sequence) REFERENCES new_segments
) STRICT, WITHOUT ROWID;

INSERT INTO new_run_segments
  SELECT x.rig, x.run, s.sequence, x.excluded
  FROM run_segments x JOIN segments s ON s.segment = x.segment;

CREATE TABLE new_calibration_segments (
  rig INTEGER NOT NULL,
  version INTEGER NOT NULL,
  sequence INTEGER NOT NULL,
  PRIMARY KEY (rig, version, sequence),
  FOREIGN KEY (rig, version) REFERENCES calibrations,
  FOREIGN KEY (rig, sequence) REFERENCES new_segments
) STRICT, WITHOUT ROWID;

INSERT INTO new_calibration_segments
  SELECT c.rig, c.version, s.sequence
  FROM calibration_segments c JOIN segments s ON s.segment = c.segment;

CREATE TABLE new_activations (
  rig INTEGER NOT NULL,
  activation INTEGER NOT NULL,  -- counts from 1 in a rig
  version INTEGER NOT NULL,
  time_ns INTEGER NOT NULL,
  steady_ns INTEGER NOT NULL DEFAULT 0,
  PRIMARY KEY (rig, activation),
  FOREIGN KEY (rig, version) REFERENCES calibrations
) STRICT, WITHOUT ROWID;

INSERT INTO new_activations
  SELECT rig, row_number() OVER (PARTITION BY rig ORDER BY activation),
    version, time_ns, steady_ns
  FROM activations;

CREATE TABLE new_events (
  rig TEXT NOT NULL,  -- empty: of the daemon
  event INTEGER NOT NULL,  -- counts from 1 for each rig
  time_ns INTEGER NOT NULL,
  -- Older events have their number over all rigs instead: they come first, in
  -- their order.
  steady_ns INTEGER NOT NULL,
  kind INTEGER NOT NULL CHECK (kind >= 1),
  detail TEXT NOT NULL,
  PRIMARY KEY (rig, event)
) STRICT, WITHOUT ROWID;

INSERT INTO new_events
  SELECT rig, row_number() OVER (PARTITION BY rig ORDER BY event), time_ns,
    event, kind, detail
  FROM events;

DROP TABLE events;
DROP TABLE activations;
DROP TABLE calibration_segments;
DROP TABLE run_segments;
DROP TABLE table_absences;
DROP TABLE table_entries;
DROP TABLE segment_ends;
DROP TABLE segment_paths;
DROP TABLE segment_scores;
DROP TABLE segment_information;
DROP TABLE payloads;
DROP TABLE segments;
ALTER TABLE new_segments RENAME TO segments;
ALTER TABLE new_payloads RENAME TO payloads;
ALTER TABLE new_segment_information RENAME TO segment_information;
ALTER TABLE new_segment_scores RENAME TO segment_scores;
ALTER TABLE new_segment_paths RENAME TO segment_paths;
ALTER TABLE new_segment_ends RENAME TO segment_ends;
ALTER TABLE new_table_entries RENAME TO table_entries;
ALTER TABLE new_table_absences RENAME TO table_absences;
ALTER TABLE new_run_segments RENAME TO run_segments;
ALTER TABLE new_calibration_segments RENAME TO calibration_segments;
ALTER TABLE new_activations RENAME TO activations;
ALTER TABLE new_events RENAME TO events;

-- The queue of the scoring workers.
CREATE INDEX unscored_segments ON segments (state, rig, sequence)
  WHERE state = 1;

CREATE INDEX entries_of_segment ON table_entries (rig, sequence, gain);

CREATE INDEX runs_of_segment ON run_segments (rig, sequence);

CREATE INDEX calibrations_of_segment ON calibration_segments (rig, sequence);

CREATE INDEX activations_of_version
  ON activations (rig, version, activation);

CREATE INDEX events_by_time ON events (steady_ns, rig, event);

CREATE TRIGGER calibration_segments_never_change
BEFORE UPDATE ON calibration_segments
BEGIN
  SELECT RAISE(ABORT, 'the origin of a calibration never changes');
END;

CREATE TRIGGER calibration_segments_stay
BEFORE DELETE ON calibration_segments
WHEN (SELECT deleting FROM rigs WHERE rig = OLD.rig) IS NOT 1
BEGIN
  SELECT RAISE(ABORT, 'the origin of a calibration is never deleted');
END;

CREATE TRIGGER activations_never_change
BEFORE UPDATE ON activations
BEGIN
  SELECT RAISE(ABORT, 'an activation never changes');
END;

CREATE TRIGGER activations_stay
BEFORE DELETE ON activations
WHEN (SELECT deleting FROM rigs WHERE rig = OLD.rig) IS NOT 1
BEGIN
  SELECT RAISE(ABORT, 'an activation is never deleted');
END;

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
