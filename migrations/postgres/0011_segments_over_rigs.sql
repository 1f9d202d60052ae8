-- Lists of the segments of all rigs by motion, by temperature, by state, and by
-- the cause of an exclusion.

-- Root mean squares over the segment (core/model/motion_statistics.h); NULL:
-- from before they were computed.
ALTER TABLE segments
  ADD COLUMN angular_rate DOUBLE PRECISION,  -- of the body [rad/s]
  ADD COLUMN acceleration DOUBLE PRECISION;  -- in G [m/s^2]

CREATE INDEX segments_by_angular_rate ON segments (rig, angular_rate, sequence)
  WHERE angular_rate IS NOT NULL;
CREATE INDEX segments_by_acceleration ON segments (rig, acceleration, sequence)
  WHERE acceleration IS NOT NULL;

CREATE INDEX all_segments_by_angular_rate
  ON segments (angular_rate, rig, sequence) WHERE angular_rate IS NOT NULL;
CREATE INDEX all_segments_by_acceleration
  ON segments (acceleration, rig, sequence) WHERE acceleration IS NOT NULL;
CREATE INDEX all_segments_by_temperature
  ON segments (temperature_c, rig, sequence) WHERE temperature_c IS NOT NULL;

-- The queue of the scoring workers, now by rig. With the state as its first
-- column, which the condition of the index implies, PostgreSQL could not search
-- it for a rig and read all segments that wait.
DROP INDEX unscored_segments;
CREATE INDEX unscored_segments ON segments (rig, sequence) WHERE state = 1;

CREATE INDEX unusable_segments_by_time ON segments (steady_ns, rig, sequence)
  WHERE state = 3;

-- When the segment arrived, copied from segments for the rare causes: all but
-- insufficient gain, outranked and displaced. NULL for the others, which are
-- most of the rows, so that these are in no index by time.
ALTER TABLE table_absences ADD COLUMN steady_ns BIGINT;

UPDATE table_absences a SET steady_ns = s.steady_ns
FROM segments s
WHERE s.rig = a.rig AND s.sequence = a.sequence AND a.cause > 3;

CREATE INDEX rare_absences_by_time
  ON table_absences (cause, steady_ns, rig, sequence)
  WHERE steady_ns IS NOT NULL;
CREATE INDEX rare_absences_of_rig ON table_absences (rig, cause, sequence)
  WHERE steady_ns IS NOT NULL;

-- Triggers set it, also for earlier programs that still run.
CREATE FUNCTION note_arrival() RETURNS trigger
LANGUAGE plpgsql AS $$
BEGIN
  NEW.steady_ns := (
    SELECT s.steady_ns FROM segments s
    WHERE s.rig = NEW.rig AND s.sequence = NEW.sequence AND NEW.cause > 3);
  RETURN NEW;
END
$$;

CREATE TRIGGER new_rare_absences_have_time
BEFORE INSERT ON table_absences FOR EACH ROW WHEN (NEW.cause > 3)
EXECUTE FUNCTION note_arrival();

CREATE TRIGGER rare_absences_have_time
BEFORE UPDATE OF cause ON table_absences FOR EACH ROW
WHEN (NEW.cause > 3 OR OLD.cause > 3)
EXECUTE FUNCTION note_arrival();
