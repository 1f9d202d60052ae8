-- The statistics of cohorts, the rigs with one value of a label, as they were
-- computed from time to time. They are of no one rig.
CREATE TABLE cohorts (
  label TEXT COLLATE "C" NOT NULL,
  value TEXT COLLATE "C" NOT NULL,
  version BIGINT NOT NULL,  -- counts from 1 in a cohort
  time_ns BIGINT NOT NULL,  -- since the Unix epoch
  content BYTEA NOT NULL,   -- selfcal.v1.Cohort
  sha256 BYTEA NOT NULL,    -- of the content
  PRIMARY KEY (label, value, version)
);

-- The version of a rig that contradicts its cohort, at a hub.
CREATE TABLE cohort_outliers (
  rig BIGINT PRIMARY KEY REFERENCES rigs,
  version BIGINT NOT NULL
);
