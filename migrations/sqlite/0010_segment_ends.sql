-- What a scored segment says about theta together with the states at its ends,
-- so that it is of use when its data is gone: of the newest segments of a rig,
-- and of all that still have their data.
CREATE TABLE segment_ends (
  segment INTEGER PRIMARY KEY REFERENCES segments,
  rig INTEGER NOT NULL REFERENCES rigs,
  ends BLOB NOT NULL,  -- SegmentEndsRecord
  sha256 BLOB NOT NULL
) STRICT;

CREATE INDEX ends_of_rig ON segment_ends (rig);
