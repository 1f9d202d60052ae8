-- The events once more: which kinds there are, the program says.

CREATE TABLE more_events (
  event INTEGER PRIMARY KEY AUTOINCREMENT,
  time_ns INTEGER NOT NULL,
  rig TEXT NOT NULL,
  kind INTEGER NOT NULL CHECK (kind >= 1),
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
