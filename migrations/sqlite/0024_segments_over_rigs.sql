-- Lists of the segments of all rigs by motion, by temperature, by state, and by
-- the cause of an exclusion.

-- Root mean squares over the segment (core/model/motion_statistics.h); NULL:
-- from before they were computed.
ALTER TABLE segments ADD COLUMN angular_rate REAL;  -- of the body [rad/s]
ALTER TABLE segments ADD COLUMN acceleration REAL;  -- in G [m/s^2]

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

-- Those that wait for their score are found by unscored_segments.
CREATE INDEX unusable_segments_by_time ON segments (steady_ns, rig, sequence)
  WHERE state = 3;

-- When the segment arrived, copied from segments for the rare causes: all but
-- insufficient gain, outranked and displaced. NULL for the others, which are
-- most of the rows, so that these are in no index by time.
ALTER TABLE table_absences ADD COLUMN steady_ns INTEGER;

UPDATE table_absences SET steady_ns =
  (SELECT s.steady_ns FROM segments s
   WHERE s.rig = table_absences.rig AND s.sequence = table_absences.sequence)
WHERE cause > 3;

CREATE INDEX rare_absences_by_time
  ON table_absences (cause, steady_ns, rig, sequence)
  WHERE steady_ns IS NOT NULL;
CREATE INDEX rare_absences_of_rig ON table_absences (rig, cause, sequence)
  WHERE steady_ns IS NOT NULL;

CREATE TRIGGER new_rare_absences_have_time
AFTER INSERT ON table_absences WHEN NEW.cause > 3
BEGIN
  UPDATE table_absences SET steady_ns =
    (SELECT s.steady_ns FROM segments s
     WHERE s.rig = NEW.rig AND s.sequence = NEW.sequence)
  WHERE rig = NEW.rig AND sequence = NEW.sequence
    AND group_name = NEW.group_name;
END;

CREATE TRIGGER rare_absences_have_time
AFTER UPDATE OF cause ON table_absences
WHEN NEW.cause > 3 OR OLD.cause > 3
BEGIN
  UPDATE table_absences SET steady_ns =
    (SELECT s.steady_ns FROM segments s
     WHERE s.rig = NEW.rig AND s.sequence = NEW.sequence AND NEW.cause > 3)
  WHERE rig = NEW.rig AND sequence = NEW.sequence
    AND group_name = NEW.group_name;
END;
