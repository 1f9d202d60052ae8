-- The life of a calibration: candidates, rolled back versions, activations by
-- hand, and what a candidate was judged by. Runs that age starts.
--
-- Two checks change, and with them their tables and those that refer to them:
-- all are written anew before the old ones go, so that no reference is ever
-- broken.

CREATE TABLE more_runs (
  rig INTEGER NOT NULL REFERENCES rigs,
  run INTEGER NOT NULL,  -- counts from 1 in a rig
  -- pending running succeeded failed cancelled
  state INTEGER NOT NULL CHECK (state IN (1, 2, 3, 4, 5)),
  -- tables full, tables changed, manual, calibration aged
  cause INTEGER NOT NULL CHECK (cause IN (1, 2, 3, 4)),
  create_time_ns INTEGER NOT NULL,
  end_time_ns INTEGER NOT NULL DEFAULT 0,
  base_version INTEGER NOT NULL,
  attempts INTEGER NOT NULL DEFAULT 0,
  calibration_version INTEGER NOT NULL DEFAULT 0,
  -- Why it ended without a calibration; while it is pending, why it is held
  -- back.
  message TEXT NOT NULL DEFAULT '',
  -- The newest change when it was created; 0: none so far. A run with cause 1
  -- after a change is the first since.
  change INTEGER NOT NULL DEFAULT 0,
  PRIMARY KEY (rig, run)
) STRICT, WITHOUT ROWID;

INSERT INTO more_runs
  SELECT rig, run, state, cause, create_time_ns, end_time_ns, base_version,
    attempts, calibration_version, message, change
  FROM runs;

CREATE TABLE more_run_segments (
  rig INTEGER NOT NULL,
  run INTEGER NOT NULL,
  segment INTEGER NOT NULL REFERENCES segments,
  PRIMARY KEY (rig, run, segment),
  FOREIGN KEY (rig, run) REFERENCES more_runs
) STRICT, WITHOUT ROWID;

INSERT INTO more_run_segments SELECT rig, run, segment FROM run_segments;

CREATE TABLE more_calibrations (
  rig INTEGER NOT NULL REFERENCES rigs,
  version INTEGER NOT NULL CHECK (version >= 1),  -- the factory's is 1
  -- active superseded rejected candidate rolled-back
  state INTEGER NOT NULL CHECK (state IN (1, 2, 3, 4, 5)),
  create_time_ns INTEGER NOT NULL,
  run INTEGER,  -- that produced it
  content BLOB NOT NULL,  -- CalibrationRecord
  sha256 BLOB NOT NULL,
  PRIMARY KEY (rig, version),
  FOREIGN KEY (rig, run) REFERENCES more_runs
) STRICT, WITHOUT ROWID;

INSERT INTO more_calibrations
  SELECT rig, version, state, create_time_ns, run, content, sha256
  FROM calibrations;

CREATE TABLE more_calibration_segments (
  rig INTEGER NOT NULL,
  version INTEGER NOT NULL,
  segment INTEGER NOT NULL REFERENCES segments,
  PRIMARY KEY (rig, version, segment),
  FOREIGN KEY (rig, version) REFERENCES more_calibrations
) STRICT, WITHOUT ROWID;

INSERT INTO more_calibration_segments
  SELECT rig, version, segment FROM calibration_segments;

CREATE TABLE more_changes (
  rig INTEGER NOT NULL REFERENCES rigs,
  change INTEGER NOT NULL CHECK (change >= 1),  -- counts from 1 in a rig
  time_ns INTEGER NOT NULL,  -- when it was detected
  kind INTEGER NOT NULL CHECK (kind IN (1, 2)),  -- sudden, drift
  -- Segments of a smaller sequence lie before it.
  first_sequence INTEGER NOT NULL,
  -- The calibration that was active: what it knows of the groups that are not
  -- concerned stays known.
  base_version INTEGER NOT NULL,
  inflation REAL NOT NULL,  -- of the variances of segments in the test
  PRIMARY KEY (rig, change),
  FOREIGN KEY (rig, base_version) REFERENCES more_calibrations
) STRICT, WITHOUT ROWID;

INSERT INTO more_changes
  SELECT rig, change, time_ns, kind, first_sequence, base_version, inflation
  FROM changes;

CREATE TABLE more_change_groups (
  rig INTEGER NOT NULL,
  change INTEGER NOT NULL,
  group_name TEXT NOT NULL,  -- concerned
  PRIMARY KEY (rig, change, group_name),
  FOREIGN KEY (rig, change) REFERENCES more_changes
) STRICT, WITHOUT ROWID;

INSERT INTO more_change_groups
  SELECT rig, change, group_name FROM change_groups;

DROP TABLE change_groups;
DROP TABLE changes;
DROP TABLE calibration_segments;
DROP TABLE calibrations;
DROP TABLE run_segments;
DROP TABLE runs;
ALTER TABLE more_runs RENAME TO runs;
ALTER TABLE more_run_segments RENAME TO run_segments;
ALTER TABLE more_calibrations RENAME TO calibrations;
ALTER TABLE more_calibration_segments RENAME TO calibration_segments;
ALTER TABLE more_changes RENAME TO changes;
ALTER TABLE more_change_groups RENAME TO change_groups;

CREATE UNIQUE INDEX one_unfinished_run ON runs (rig) WHERE state IN (1, 2);

CREATE INDEX runs_of_segment ON run_segments (segment);

CREATE UNIQUE INDEX one_active_calibration ON calibrations (rig)
  WHERE state = 1;

CREATE UNIQUE INDEX one_candidate ON calibrations (rig) WHERE state = 4;

CREATE TRIGGER calibrations_never_change
BEFORE UPDATE OF rig, version, create_time_ns, run, content, sha256
ON calibrations
BEGIN
  SELECT RAISE(ABORT, 'a calibration version never changes');
END;

CREATE TRIGGER calibrations_stay
BEFORE DELETE ON calibrations
BEGIN
  SELECT RAISE(ABORT, 'a calibration version is never deleted');
END;

-- As in server/store/calibration_states.cc.
CREATE TRIGGER calibrations_begin_as_candidates
BEFORE INSERT ON calibrations
WHEN NOT (NEW.state = 4 OR (NEW.state = 1 AND NEW.version = 1))
BEGIN
  SELECT RAISE(ABORT, 'a calibration begins as a candidate');
END;

CREATE TRIGGER calibration_transitions
BEFORE UPDATE OF state ON calibrations
WHEN (OLD.state, NEW.state) NOT IN (VALUES
  (4, 1),  -- candidate -> active
  (4, 3),  -- candidate -> rejected
  (1, 2),  -- active -> superseded
  (1, 5),  -- active -> rolled back
  (2, 1),  -- superseded -> active
  (5, 1))  -- rolled back -> active
BEGIN
  SELECT RAISE(ABORT, 'a calibration does not change its state like that');
END;

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

-- Each time that a version became the active one.
CREATE TABLE activations (
  activation INTEGER PRIMARY KEY AUTOINCREMENT,  -- in their order
  rig INTEGER NOT NULL,
  version INTEGER NOT NULL,
  time_ns INTEGER NOT NULL,
  FOREIGN KEY (rig, version) REFERENCES calibrations
) STRICT;

CREATE INDEX activations_of_version ON activations (rig, version);

-- Versions from before became active as they were created.
INSERT INTO activations (rig, version, time_ns)
  SELECT rig, version, create_time_ns FROM calibrations
  WHERE state IN (1, 2) ORDER BY rig, version;

CREATE TRIGGER activations_never_change
BEFORE UPDATE ON activations
BEGIN
  SELECT RAISE(ABORT, 'an activation never changes');
END;

CREATE TRIGGER activations_stay
BEFORE DELETE ON activations
BEGIN
  SELECT RAISE(ABORT, 'an activation is never deleted');
END;

-- What a candidate was judged by, and what came of it. Versions from before
-- have none: their reasons lie in their content.
CREATE TABLE validations (
  rig INTEGER NOT NULL,
  version INTEGER NOT NULL,
  content BLOB NOT NULL,  -- ValidationRecord
  sha256 BLOB NOT NULL,
  PRIMARY KEY (rig, version),
  FOREIGN KEY (rig, version) REFERENCES calibrations
) STRICT, WITHOUT ROWID;

CREATE TRIGGER validations_never_change
BEFORE UPDATE ON validations
BEGIN
  SELECT RAISE(ABORT, 'a validation never changes');
END;

CREATE TRIGGER validations_stay
BEFORE DELETE ON validations
BEGIN
  SELECT RAISE(ABORT, 'a validation is never deleted');
END;
