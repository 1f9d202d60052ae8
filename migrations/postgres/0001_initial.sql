-- Everything that selfcald stores: the tables, columns, constraints and triggers
-- that the files in ../sqlite add up to. Times are nanoseconds since the Unix
-- epoch unless a comment says otherwise. A column sha256 is the checksum of the
-- blob beside it, verified whenever the blob is read. Blobs are messages of
-- proto/selfcal/store/records.proto. Text is compared by its bytes, as SQLite
-- does.
--
-- Every key and every unique constraint begins with the rig, except that of its
-- name, and numbers are counted within a rig, by the transaction that holds the
-- lock on its row in rigs: so the tables can be distributed by rig.

-- Refuses a change; its argument is the message.
CREATE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
  RAISE EXCEPTION '%', TG_ARGV[0];
END
$$;

CREATE TABLE rigs (
  rig BIGINT PRIMARY KEY,  -- chosen at random
  id TEXT COLLATE "C" NOT NULL UNIQUE,
  create_time_ns BIGINT NOT NULL,
  definition BYTEA NOT NULL,  -- RigRecord
  sha256 BYTEA NOT NULL,
  -- When the newest segment arrived; 0: none so far.
  last_seen_ns BIGINT NOT NULL DEFAULT 0,
  -- 1 in the transaction that deletes the rig: only then are records removed
  -- that otherwise never change.
  deleting BIGINT NOT NULL DEFAULT 0
);

CREATE INDEX rigs_by_last_seen ON rigs (last_seen_ns, id);

-- Refuses the deletion of a row, except with its whole rig; its argument is the
-- message.
CREATE FUNCTION refuse_unless_rig_is_deleted() RETURNS trigger
LANGUAGE plpgsql AS $$
BEGIN
  IF EXISTS (SELECT 1 FROM rigs WHERE rig = OLD.rig AND deleting = 1) THEN
    RETURN OLD;
  END IF;
  RAISE EXCEPTION '%', TG_ARGV[0];
END
$$;

-- What the definition of a rig contains, to search by.
CREATE TABLE rig_labels (
  rig BIGINT NOT NULL REFERENCES rigs,
  name TEXT COLLATE "C" NOT NULL,
  value TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (rig, name)
);

-- Metadata of every segment ever received.
CREATE TABLE segments (
  rig BIGINT NOT NULL REFERENCES rigs,
  sequence BIGINT NOT NULL,  -- order of arrival in the rig, from 1
  session TEXT COLLATE "C" NOT NULL,
  session_index BIGINT NOT NULL,
  state BIGINT NOT NULL CHECK (state IN (1, 2, 3)),  -- stored scored unusable
  problem TEXT COLLATE "C" NOT NULL DEFAULT '',
  receive_time_ns BIGINT NOT NULL,
  calibration_version BIGINT NOT NULL,
  start_ns BIGINT NOT NULL,  -- clock of the session
  end_ns BIGINT NOT NULL,    -- clock of the session
  keyframes BIGINT NOT NULL,
  imu_samples BIGINT NOT NULL,
  landmarks BIGINT NOT NULL,
  observations BIGINT NOT NULL,
  temperature_c DOUBLE PRECISION,  -- of the device; NULL: not known
  -- Root of what the squares of all whitened residuals keep, over their
  -- expectation; 0: not measured.
  fit DOUBLE PRECISION NOT NULL DEFAULT 0,
  -- Steady time of the arrival: the wall clock without its jumps.
  steady_ns BIGINT NOT NULL DEFAULT 0,
  PRIMARY KEY (rig, sequence),
  UNIQUE (rig, session, session_index)
);

-- The queue of the scoring workers.
CREATE INDEX unscored_segments ON segments (state, rig, sequence)
  WHERE state = 1;

-- Data of a segment: while it waits for its score, and while a table or an
-- unfinished run references it.
CREATE TABLE payloads (
  rig BIGINT NOT NULL,
  sequence BIGINT NOT NULL,
  data BYTEA NOT NULL,  -- zstd frame of a selfcal.v1.MotionSegment
  raw_bytes BIGINT NOT NULL,  -- before compression
  sha256 BYTEA NOT NULL,  -- of data
  PRIMARY KEY (rig, sequence),
  FOREIGN KEY (rig, sequence) REFERENCES segments
);

-- It is compressed already.
ALTER TABLE payloads ALTER COLUMN data SET STORAGE EXTERNAL;

-- The information of a scored segment about theta; never removed.
CREATE TABLE segment_information (
  rig BIGINT NOT NULL,
  sequence BIGINT NOT NULL,
  information BYTEA NOT NULL,  -- SegmentInformationRecord
  sha256 BYTEA NOT NULL,
  PRIMARY KEY (rig, sequence),
  FOREIGN KEY (rig, sequence) REFERENCES segments
);

-- The part of it that is listed and sorted, in nats.
CREATE TABLE segment_scores (
  rig BIGINT NOT NULL,
  sequence BIGINT NOT NULL,
  group_name TEXT COLLATE "C" NOT NULL,
  entropy DOUBLE PRECISION,  -- NULL: not a number
  gain DOUBLE PRECISION,
  rank BIGINT NOT NULL,
  PRIMARY KEY (rig, sequence, group_name),
  FOREIGN KEY (rig, sequence) REFERENCES segments
);

-- A few positions of the body, rounded: for pictures, not for estimates.
CREATE TABLE segment_paths (
  rig BIGINT NOT NULL,
  sequence BIGINT NOT NULL,
  path BYTEA NOT NULL,  -- SegmentPathRecord
  sha256 BYTEA NOT NULL,
  PRIMARY KEY (rig, sequence),
  FOREIGN KEY (rig, sequence) REFERENCES segments
);

-- The information of a scored segment about theta and the states at its ends,
-- for when its data is gone: of the newest segments of a rig, and of all that
-- still have their data.
CREATE TABLE segment_ends (
  rig BIGINT NOT NULL,
  sequence BIGINT NOT NULL,
  ends BYTEA NOT NULL,  -- SegmentEndsRecord
  sha256 BYTEA NOT NULL,
  PRIMARY KEY (rig, sequence),
  FOREIGN KEY (rig, sequence) REFERENCES segments
);

-- One table for each group of a rig.
CREATE TABLE tables (
  rig BIGINT NOT NULL REFERENCES rigs,
  group_name TEXT COLLATE "C" NOT NULL,
  position BIGINT NOT NULL,  -- of the group in the rig
  capacity BIGINT NOT NULL,
  scored BIGINT NOT NULL,  -- segments that were offered
  PRIMARY KEY (rig, group_name)
);

CREATE TABLE table_entries (
  rig BIGINT NOT NULL,
  group_name TEXT COLLATE "C" NOT NULL,
  sequence BIGINT NOT NULL,
  entropy DOUBLE PRECISION NOT NULL,
  gain DOUBLE PRECISION NOT NULL,
  PRIMARY KEY (rig, group_name, sequence),
  FOREIGN KEY (rig, group_name) REFERENCES tables,
  FOREIGN KEY (rig, sequence) REFERENCES segments
);

CREATE INDEX entries_of_segment ON table_entries (rig, sequence, gain);

-- A scored segment that is not in the table of a group, or not any more.
CREATE TABLE table_absences (
  rig BIGINT NOT NULL,
  sequence BIGINT NOT NULL,
  group_name TEXT COLLATE "C" NOT NULL,
  -- insufficient gain, outranked, displaced, too old, device changed, data
  -- evicted, unusable, does not fit, many outliers
  cause BIGINT NOT NULL CHECK (cause >= 1),
  time_ns BIGINT NOT NULL,
  -- Sequence of the worst that was in the table, or of what took the place of
  -- this one; the segment may be gone since. NULL for other causes.
  rival BIGINT,
  rival_entropy DOUBLE PRECISION,
  -- The fit of a segment that does not fit, and the largest fit of those that
  -- do; NULL for other causes.
  fit DOUBLE PRECISION,
  fit_limit DOUBLE PRECISION,
  PRIMARY KEY (rig, sequence, group_name),
  FOREIGN KEY (rig, sequence) REFERENCES segments
);

CREATE TABLE runs (
  rig BIGINT NOT NULL REFERENCES rigs,
  run BIGINT NOT NULL,  -- counts from 1 in a rig
  -- pending running succeeded failed cancelled
  state BIGINT NOT NULL CHECK (state IN (1, 2, 3, 4, 5)),
  -- tables full, tables changed, manual, calibration aged
  cause BIGINT NOT NULL CHECK (cause IN (1, 2, 3, 4)),
  create_time_ns BIGINT NOT NULL,
  end_time_ns BIGINT NOT NULL DEFAULT 0,
  base_version BIGINT NOT NULL,
  attempts BIGINT NOT NULL DEFAULT 0,
  calibration_version BIGINT NOT NULL DEFAULT 0,
  -- Why it ended without a calibration; while it is pending, why it is deferred.
  message TEXT COLLATE "C" NOT NULL DEFAULT '',
  -- The newest change when it was created; 0: none so far. A run with cause 1
  -- after a change is the first since.
  change BIGINT NOT NULL DEFAULT 0,
  -- 1, with cause 2: the tables have changed, and the session has ended.
  session_ended BIGINT NOT NULL DEFAULT 0,
  create_steady_ns BIGINT NOT NULL DEFAULT 0,
  end_steady_ns BIGINT NOT NULL DEFAULT 0,
  PRIMARY KEY (rig, run)
);

CREATE UNIQUE INDEX one_unfinished_run ON runs (rig) WHERE state IN (1, 2);

-- The snapshot of the tables that a run works on.
CREATE TABLE run_segments (
  rig BIGINT NOT NULL,
  run BIGINT NOT NULL,
  sequence BIGINT NOT NULL,
  -- 1: quarantined because of the result of the run, which does not use it.
  excluded BIGINT NOT NULL DEFAULT 0,
  PRIMARY KEY (rig, run, sequence),
  FOREIGN KEY (rig, run) REFERENCES runs,
  FOREIGN KEY (rig, sequence) REFERENCES segments
);

CREATE INDEX runs_of_segment ON run_segments (rig, sequence);

-- Versions of a calibration: append-only, but for the state.
CREATE TABLE calibrations (
  rig BIGINT NOT NULL REFERENCES rigs,
  version BIGINT NOT NULL CHECK (version >= 1),  -- the factory's is 1
  -- active superseded rejected candidate rolled-back
  state BIGINT NOT NULL CHECK (state IN (1, 2, 3, 4, 5)),
  create_time_ns BIGINT NOT NULL,
  run BIGINT,  -- that produced it
  content BYTEA NOT NULL,  -- CalibrationRecord
  sha256 BYTEA NOT NULL,
  create_steady_ns BIGINT NOT NULL DEFAULT 0,
  PRIMARY KEY (rig, version),
  FOREIGN KEY (rig, run) REFERENCES runs
);

CREATE UNIQUE INDEX one_active_calibration ON calibrations (rig)
  WHERE state = 1;

CREATE UNIQUE INDEX one_candidate ON calibrations (rig) WHERE state = 4;

CREATE TRIGGER calibrations_never_change
BEFORE UPDATE OF rig, version, create_time_ns, create_steady_ns, run, content,
  sha256
ON calibrations FOR EACH ROW
EXECUTE FUNCTION refuse('a calibration version never changes');

CREATE TRIGGER calibrations_stay
BEFORE DELETE ON calibrations FOR EACH ROW
EXECUTE FUNCTION refuse_unless_rig_is_deleted(
  'a calibration version is never deleted');

CREATE TRIGGER calibrations_are_not_truncated
BEFORE TRUNCATE ON calibrations
EXECUTE FUNCTION refuse('a calibration version is never deleted');

CREATE TRIGGER calibrations_begin_as_candidates
BEFORE INSERT ON calibrations FOR EACH ROW
WHEN (NOT (NEW.state = 4 OR (NEW.state = 1 AND NEW.version = 1)))
EXECUTE FUNCTION refuse('a calibration begins as a candidate');

CREATE TRIGGER calibration_transitions
BEFORE UPDATE OF state ON calibrations FOR EACH ROW
WHEN ((OLD.state, NEW.state) NOT IN (
  (4, 1),   -- candidate -> active
  (4, 3),   -- candidate -> rejected
  (1, 2),   -- active -> superseded
  (1, 5),   -- active -> rolled back
  (2, 1),   -- superseded -> active
  (5, 1)))  -- rolled back -> active
EXECUTE FUNCTION refuse('a calibration does not change its state like that');

-- Which segments a version came from.
CREATE TABLE calibration_segments (
  rig BIGINT NOT NULL,
  version BIGINT NOT NULL,
  sequence BIGINT NOT NULL,
  PRIMARY KEY (rig, version, sequence),
  FOREIGN KEY (rig, version) REFERENCES calibrations,
  FOREIGN KEY (rig, sequence) REFERENCES segments
);

CREATE INDEX calibrations_of_segment ON calibration_segments (rig, sequence);

CREATE TRIGGER calibration_segments_never_change
BEFORE UPDATE ON calibration_segments FOR EACH ROW
EXECUTE FUNCTION refuse('the origin of a calibration never changes');

CREATE TRIGGER calibration_segments_stay
BEFORE DELETE ON calibration_segments FOR EACH ROW
EXECUTE FUNCTION refuse_unless_rig_is_deleted(
  'the origin of a calibration is never deleted');

CREATE TRIGGER calibration_segments_are_not_truncated
BEFORE TRUNCATE ON calibration_segments
EXECUTE FUNCTION refuse('the origin of a calibration is never deleted');

-- Each time that a version became the active one.
CREATE TABLE activations (
  rig BIGINT NOT NULL,
  activation BIGINT NOT NULL,  -- counts from 1 in a rig
  version BIGINT NOT NULL,
  time_ns BIGINT NOT NULL,
  steady_ns BIGINT NOT NULL DEFAULT 0,
  PRIMARY KEY (rig, activation),
  FOREIGN KEY (rig, version) REFERENCES calibrations
);

CREATE INDEX activations_of_version
  ON activations (rig, version, activation);

CREATE TRIGGER activations_never_change
BEFORE UPDATE ON activations FOR EACH ROW
EXECUTE FUNCTION refuse('an activation never changes');

CREATE TRIGGER activations_stay
BEFORE DELETE ON activations FOR EACH ROW
EXECUTE FUNCTION refuse_unless_rig_is_deleted(
  'an activation is never deleted');

CREATE TRIGGER activations_are_not_truncated
BEFORE TRUNCATE ON activations
EXECUTE FUNCTION refuse('an activation is never deleted');

-- The checks of a candidate, and their result.
CREATE TABLE validations (
  rig BIGINT NOT NULL,
  version BIGINT NOT NULL,
  content BYTEA NOT NULL,  -- ValidationRecord
  sha256 BYTEA NOT NULL,
  PRIMARY KEY (rig, version),
  FOREIGN KEY (rig, version) REFERENCES calibrations
);

CREATE TRIGGER validations_never_change
BEFORE UPDATE ON validations FOR EACH ROW
EXECUTE FUNCTION refuse('a validation never changes');

CREATE TRIGGER validations_stay
BEFORE DELETE ON validations FOR EACH ROW
EXECUTE FUNCTION refuse_unless_rig_is_deleted(
  'a validation is never deleted');

CREATE TRIGGER validations_are_not_truncated
BEFORE TRUNCATE ON validations
EXECUTE FUNCTION refuse('a validation is never deleted');

-- Versions of a calibration on which the two cores disagreed when it was
-- computed by both. A version keeps the first finding.
CREATE TABLE disagreements (
  rig BIGINT NOT NULL,
  version BIGINT NOT NULL,
  time_ns BIGINT NOT NULL,
  finding TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (rig, version),
  FOREIGN KEY (rig, version) REFERENCES calibrations
);

-- Changes of the device: segments before one inform about another calibration.
CREATE TABLE changes (
  rig BIGINT NOT NULL REFERENCES rigs,
  change BIGINT NOT NULL CHECK (change >= 1),  -- counts from 1 in a rig
  time_ns BIGINT NOT NULL,  -- when it was detected
  kind BIGINT NOT NULL CHECK (kind IN (1, 2)),  -- sudden, drift
  -- Segments of a smaller sequence lie before it.
  first_sequence BIGINT NOT NULL,
  -- The calibration that was active: what it knows of the groups that are not
  -- concerned stays known.
  base_version BIGINT NOT NULL,
  inflation DOUBLE PRECISION NOT NULL,  -- of the variances of segments in the test
  PRIMARY KEY (rig, change),
  FOREIGN KEY (rig, base_version) REFERENCES calibrations
);

CREATE TABLE change_groups (
  rig BIGINT NOT NULL,
  change BIGINT NOT NULL,
  group_name TEXT COLLATE "C" NOT NULL,  -- concerned
  PRIMARY KEY (rig, change, group_name),
  FOREIGN KEY (rig, change) REFERENCES changes
);

-- The event log, one row each. An event stays when its rig is deleted, so the
-- rig is its name.
CREATE TABLE events (
  rig TEXT COLLATE "C" NOT NULL,  -- empty: of the daemon
  event BIGINT NOT NULL,  -- counts from 1 for each rig
  time_ns BIGINT NOT NULL,
  steady_ns BIGINT NOT NULL,
  kind BIGINT NOT NULL CHECK (kind >= 1),
  detail TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (rig, event)
);

CREATE INDEX events_by_time ON events (steady_ns, rig, event);

CREATE TRIGGER events_never_change
BEFORE UPDATE ON events FOR EACH ROW
EXECUTE FUNCTION refuse('an event never changes');

CREATE TRIGGER events_stay
BEFORE DELETE ON events FOR EACH ROW
EXECUTE FUNCTION refuse('an event is never deleted');

CREATE TRIGGER events_are_not_truncated
BEFORE TRUNCATE ON events
EXECUTE FUNCTION refuse('an event is never deleted');

-- The daemons that share the database, while they run.
CREATE TABLE replicas (
  replica TEXT COLLATE "C" PRIMARY KEY,
  beat BIGINT NOT NULL  -- grows while it runs
);

-- Which of them scores the segments and executes the runs of a rig.
CREATE TABLE claims (
  rig BIGINT PRIMARY KEY REFERENCES rigs,
  replica TEXT COLLATE "C" NOT NULL,  -- empty: none; it may be gone
  number BIGINT NOT NULL  -- counts the claims of the rig: the newest one holds
);

-- The rigs of a replica.
CREATE INDEX claims_of_replica ON claims (replica);

-- One row: the clocks of the device at one moment, from which steady time
-- continues.
CREATE TABLE clock (
  clock BIGINT PRIMARY KEY CHECK (clock = 1),
  boot TEXT COLLATE "C" NOT NULL,  -- names the time since the machine was booted
  since_boot_ns BIGINT NOT NULL,
  time_ns BIGINT NOT NULL,
  steady_ns BIGINT NOT NULL,
  keep_until_ns BIGINT NOT NULL  -- nothing is removed for its age before this
);
