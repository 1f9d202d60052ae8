-- Labels of rigs, and the deletion of a whole rig.

-- What the definition of a rig has, to search by.
CREATE TABLE rig_labels (
  rig INTEGER NOT NULL REFERENCES rigs,
  name TEXT NOT NULL,
  value TEXT NOT NULL,
  PRIMARY KEY (rig, name)
) STRICT, WITHOUT ROWID;

-- 1 in the transaction that deletes the rig: only then what never changes goes.
ALTER TABLE rigs ADD COLUMN deleting INTEGER NOT NULL DEFAULT 0;

DROP TRIGGER calibrations_stay;
CREATE TRIGGER calibrations_stay
BEFORE DELETE ON calibrations
WHEN (SELECT deleting FROM rigs WHERE rig = OLD.rig) IS NOT 1
BEGIN
  SELECT RAISE(ABORT, 'a calibration version is never deleted');
END;

DROP TRIGGER calibration_segments_stay;
CREATE TRIGGER calibration_segments_stay
BEFORE DELETE ON calibration_segments
WHEN (SELECT deleting FROM rigs WHERE rig = OLD.rig) IS NOT 1
BEGIN
  SELECT RAISE(ABORT, 'the origin of a calibration is never deleted');
END;

DROP TRIGGER activations_stay;
CREATE TRIGGER activations_stay
BEFORE DELETE ON activations
WHEN (SELECT deleting FROM rigs WHERE rig = OLD.rig) IS NOT 1
BEGIN
  SELECT RAISE(ABORT, 'an activation is never deleted');
END;

DROP TRIGGER validations_stay;
CREATE TRIGGER validations_stay
BEFORE DELETE ON validations
WHEN (SELECT deleting FROM rigs WHERE rig = OLD.rig) IS NOT 1
BEGIN
  SELECT RAISE(ABORT, 'a validation is never deleted');
END;
