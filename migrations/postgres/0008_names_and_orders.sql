-- Lists that had no index: the rigs whose name contains a text, and the segments
-- of a rig by landmarks, by observations, of a session, and unusable ones.

-- The suffixes of the name of each rig: cam has cam, am and m. A name
-- contains a text if one of them begins with it. They are in a table of their
-- own because an index of rigs would be written with each segment.
CREATE TABLE rig_name_suffixes (
  rig BIGINT NOT NULL,
  suffix TEXT COLLATE "C" NOT NULL
);

-- A trigger adds those of a new rig, also for earlier programs that still run.
-- It precedes the rows: none of these programs adds a rig between the two.
CREATE FUNCTION add_name_suffixes() RETURNS trigger
LANGUAGE plpgsql AS $$
BEGIN
  INSERT INTO rig_name_suffixes (rig, suffix)
    SELECT NEW.rig, substr(NEW.id, k) FROM generate_series(1, length(NEW.id)) k;
  RETURN NULL;
END
$$;

CREATE TRIGGER rigs_have_name_suffixes
AFTER INSERT ON rigs FOR EACH ROW
EXECUTE FUNCTION add_name_suffixes();

INSERT INTO rig_name_suffixes (rig, suffix)
  SELECT r.rig, substr(r.id, k)
  FROM rigs r, generate_series(1, length(r.id)) k;

-- The constraints follow the rows, which takes a fraction of the time.
ALTER TABLE rig_name_suffixes
  ADD PRIMARY KEY (rig, suffix),
  ADD FOREIGN KEY (rig) REFERENCES rigs ON DELETE CASCADE;

CREATE INDEX rigs_by_name_suffix ON rig_name_suffixes (suffix, rig);

ANALYZE rig_name_suffixes;

CREATE INDEX segments_by_landmarks ON segments (rig, landmarks, sequence);

CREATE INDEX segments_by_observations ON segments (rig, observations, sequence);

CREATE INDEX segments_by_session ON segments (rig, session, sequence);

CREATE INDEX unusable_segments ON segments (rig, sequence) WHERE state = 3;
