-- Changes of the device: segments before one speak of another calibration.

CREATE TABLE changes (
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
  FOREIGN KEY (rig, base_version) REFERENCES calibrations
) STRICT, WITHOUT ROWID;

CREATE TABLE change_groups (
  rig INTEGER NOT NULL,
  change INTEGER NOT NULL,
  group_name TEXT NOT NULL,  -- concerned
  PRIMARY KEY (rig, change, group_name),
  FOREIGN KEY (rig, change) REFERENCES changes
) STRICT, WITHOUT ROWID;

-- The newest change when the run was created; 0: none so far. A run with cause
-- 1 after a change is the first since.
ALTER TABLE runs ADD COLUMN change INTEGER NOT NULL DEFAULT 0;

-- The events once more, with another kind.
CREATE TABLE more_events (
  event INTEGER PRIMARY KEY AUTOINCREMENT,
  time_ns INTEGER NOT NULL,
  rig TEXT NOT NULL,
  kind INTEGER NOT NULL CHECK (kind BETWEEN 1 AND 7),
  detail TEXT NOT NULL
) STRICT;

INSERT INTO more_events SELECT event, time_ns, rig, kind, detail FROM events;

DROP TABLE events;

ALTER TABLE more_events RENAME TO events;

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
