-- Lists of versions by state, verdict and temperature, and of runs by state,
-- trigger and duration, of all rigs.

-- The verdict of the validation, as Verdict.Kind of the contract; 0: not
-- validated. NULL: written by a program from before, and completed later
-- (CompleteVersions of server/domain/domain.h), as is the temperature.
ALTER TABLE calibrations ADD COLUMN validated INTEGER;
-- The verdict that is shown. NULL: not known before the version is completed.
ALTER TABLE calibrations ADD COLUMN verdict INTEGER;
-- Mean over the segments that report one [degrees Celsius]; NULL: none does.
ALTER TABLE calibrations ADD COLUMN temperature_c REAL;

-- The kind of VerdictOf (server/pipeline/verdict.h).
CREATE VIEW shown_verdicts AS
SELECT c.rig, c.version,
  CASE
    WHEN c.run IS NULL THEN 4
    WHEN c.state = 3 THEN 3
    WHEN EXISTS (
      SELECT 1 FROM disagreements d
      WHERE d.rig = c.rig AND d.version = c.version) THEN 3
    WHEN c.state = 1 AND EXISTS (
      SELECT 1 FROM runs q
      JOIN changes h ON h.rig = q.rig AND h.change > q.change
      WHERE q.rig = c.rig AND q.run = c.run AND h.time_ns <> q.end_time_ns)
      THEN 3
    ELSE coalesce(c.validated, CASE c.state WHEN 4 THEN 0 END)
  END AS kind
FROM calibrations c;

UPDATE calibrations SET verdict =
  (SELECT s.kind FROM shown_verdicts s
   WHERE s.rig = calibrations.rig AND s.version = calibrations.version);

-- Triggers write it, whatever record it changes with.
CREATE TRIGGER versions_begin_with_a_verdict
AFTER INSERT ON calibrations
BEGIN
  UPDATE calibrations SET verdict =
    (SELECT s.kind FROM shown_verdicts s
     WHERE s.rig = NEW.rig AND s.version = NEW.version)
  WHERE rig = NEW.rig AND version = NEW.version;
END;

CREATE TRIGGER verdicts_follow_states
AFTER UPDATE OF state, validated ON calibrations
BEGIN
  UPDATE calibrations SET verdict =
    (SELECT s.kind FROM shown_verdicts s
     WHERE s.rig = NEW.rig AND s.version = NEW.version)
  WHERE rig = NEW.rig AND version = NEW.version;
END;

CREATE TRIGGER verdicts_follow_findings
AFTER INSERT ON disagreements
BEGIN
  UPDATE calibrations SET verdict =
    (SELECT s.kind FROM shown_verdicts s
     WHERE s.rig = NEW.rig AND s.version = NEW.version)
  WHERE rig = NEW.rig AND version = NEW.version;
END;

-- A device change concerns the active version only.
CREATE TRIGGER verdicts_follow_changes
AFTER INSERT ON changes
BEGIN
  UPDATE calibrations SET verdict =
    (SELECT s.kind FROM shown_verdicts s
     WHERE s.rig = NEW.rig AND s.version = calibrations.version)
  WHERE rig = NEW.rig AND state = 1;
END;

-- The run that finds a change ends at its time.
CREATE TRIGGER verdicts_follow_ends_of_runs
AFTER UPDATE OF end_time_ns ON runs
WHEN OLD.end_time_ns <> NEW.end_time_ns
BEGIN
  UPDATE calibrations SET verdict =
    (SELECT s.kind FROM shown_verdicts s
     WHERE s.rig = NEW.rig AND s.version = calibrations.version)
  WHERE rig = NEW.rig AND state = 1;
END;

-- RunTrigger of server/store/run_query.h: those that were there first share a
-- cause; any other one has its number in session_ended.
ALTER TABLE runs ADD COLUMN started_by INTEGER GENERATED ALWAYS AS (
  CASE cause
    WHEN 1 THEN CASE WHEN change > 0 THEN 4 ELSE 1 END
    WHEN 2 THEN CASE WHEN session_ended <> 0 THEN 6 ELSE 2 END
    WHEN 4 THEN 5
    ELSE CASE WHEN session_ended <> 0 THEN session_ended ELSE 3 END
  END) VIRTUAL;
-- NULL: it has not ended.
ALTER TABLE runs ADD COLUMN duration_ns INTEGER GENERATED ALWAYS AS (
  CASE WHEN end_time_ns <> 0 THEN end_time_ns - create_time_ns END) VIRTUAL;

CREATE INDEX calibrations_by_creation
  ON calibrations (create_time_ns, rig, version);

CREATE INDEX calibrations_by_state
  ON calibrations (state, create_time_ns, rig, version);

CREATE INDEX calibrations_by_verdict
  ON calibrations (verdict, create_time_ns, rig, version);

CREATE INDEX calibrations_by_temperature
  ON calibrations (temperature_c, rig, version)
  WHERE temperature_c IS NOT NULL;

-- A candidate is not validated yet.
CREATE INDEX incomplete_calibrations ON calibrations (rig, version)
  WHERE validated IS NULL AND state <> 4;

CREATE INDEX runs_by_creation ON runs (create_time_ns, rig, run);

CREATE INDEX runs_by_state ON runs (state, create_time_ns, rig, run);

CREATE INDEX runs_by_trigger ON runs (started_by, create_time_ns, rig, run);

CREATE INDEX runs_by_duration ON runs (duration_ns, rig, run)
  WHERE duration_ns IS NOT NULL;
