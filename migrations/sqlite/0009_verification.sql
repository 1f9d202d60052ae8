-- Versions of a calibration on which the two cores disagreed when it was
-- computed by both. A version keeps the first finding.
CREATE TABLE disagreements (
  rig INTEGER NOT NULL,
  version INTEGER NOT NULL,
  time_ns INTEGER NOT NULL,
  finding TEXT NOT NULL,
  PRIMARY KEY (rig, version),
  FOREIGN KEY (rig, version) REFERENCES calibrations
) STRICT, WITHOUT ROWID;
