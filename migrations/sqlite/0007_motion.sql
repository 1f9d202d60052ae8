-- What stays of a segment for whoever looks back: where the device went, and
-- why a table does not hold it. Both go with the metadata.

-- A few positions of the body, rounded: for pictures, not for estimates.
-- Segments from before have none.
CREATE TABLE segment_paths (
  segment INTEGER PRIMARY KEY REFERENCES segments,
  path BLOB NOT NULL,  -- SegmentPathRecord
  sha256 BLOB NOT NULL
) STRICT;

-- A scored segment that is in the table of a group no more, or never was.
-- Segments that left from before have none.
CREATE TABLE table_absences (
  segment INTEGER NOT NULL REFERENCES segments,
  group_name TEXT NOT NULL,
  -- says too little, others say more, pushed out, too old, device changed,
  -- data evicted, unusable
  cause INTEGER NOT NULL CHECK (cause >= 1),
  time_ns INTEGER NOT NULL,
  -- The worst that was in the table, or what took the place of this one; the
  -- segment may be gone since. NULL for other causes.
  rival INTEGER,
  rival_entropy REAL,
  PRIMARY KEY (segment, group_name)
) STRICT, WITHOUT ROWID;
