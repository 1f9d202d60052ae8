-- The statistics of cohorts, the rigs with one value of a label, as they were
-- computed from time to time. They are of no one rig.
CREATE TABLE cohorts (
  label TEXT NOT NULL,
  value TEXT NOT NULL,
  version INTEGER NOT NULL,  -- counts from 1 in a cohort
  time_ns INTEGER NOT NULL,  -- since the Unix epoch
  content BLOB NOT NULL,     -- selfcal.v1.Cohort
  sha256 BLOB NOT NULL,      -- of the content
  PRIMARY KEY (label, value, version)
) STRICT;

-- The version of a rig that contradicts its cohort, at a hub.
CREATE TABLE cohort_outliers (
  rig INTEGER PRIMARY KEY REFERENCES rigs,
  version INTEGER NOT NULL
) STRICT;
