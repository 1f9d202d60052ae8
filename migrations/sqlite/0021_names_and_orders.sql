-- Lists that had no index: the rigs whose name contains a text, and the segments
-- of a rig by landmarks, by observations, of a session, and unusable ones.

-- The suffixes of the name of each rig: cam has cam, am and m. A name
-- contains a text if one of them begins with it.
CREATE TABLE rig_name_suffixes (
  rig INTEGER NOT NULL REFERENCES rigs ON DELETE CASCADE,
  suffix TEXT NOT NULL,
  PRIMARY KEY (rig, suffix)
) STRICT, WITHOUT ROWID;

-- The name of a rig has at most 63 characters.
CREATE TRIGGER rigs_have_name_suffixes
AFTER INSERT ON rigs
BEGIN
  INSERT INTO rig_name_suffixes (rig, suffix)
  SELECT NEW.rig, substr(NEW.id, column1) FROM (VALUES
    (1), (2), (3), (4), (5), (6), (7), (8), (9), (10), (11), (12), (13), (14),
    (15), (16), (17), (18), (19), (20), (21), (22), (23), (24), (25), (26),
    (27), (28), (29), (30), (31), (32), (33), (34), (35), (36), (37), (38),
    (39), (40), (41), (42), (43), (44), (45), (46), (47), (48), (49), (50),
    (51), (52), (53), (54), (55), (56), (57), (58), (59), (60), (61), (62),
    (63), (64))
  WHERE column1 <= length(NEW.id);
END;

INSERT INTO rig_name_suffixes (rig, suffix)
WITH RECURSIVE suffixes (rig, suffix) AS (
  SELECT rig, id FROM rigs
  UNION ALL
  SELECT rig, substr(suffix, 2) FROM suffixes WHERE length(suffix) > 1
)
SELECT rig, suffix FROM suffixes;

CREATE INDEX rigs_by_name_suffix ON rig_name_suffixes (suffix, rig);

CREATE INDEX segments_by_landmarks ON segments (rig, landmarks, sequence);

CREATE INDEX segments_by_observations ON segments (rig, observations, sequence);

CREATE INDEX segments_by_session ON segments (rig, session, sequence);

CREATE INDEX unusable_segments ON segments (rig, sequence) WHERE state = 3;
