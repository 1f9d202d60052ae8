-- Records by which daemons share a database. A file of SQLite has one daemon,
-- which needs none of them.

-- The daemons, while they run.
CREATE TABLE replicas (
  replica TEXT PRIMARY KEY,
  beat INTEGER NOT NULL  -- grows while it runs
) STRICT, WITHOUT ROWID;

-- Which of them scores the segments and executes the runs of a rig.
CREATE TABLE claims (
  rig INTEGER PRIMARY KEY REFERENCES rigs,
  replica TEXT NOT NULL,  -- empty: none; it may be gone
  number INTEGER NOT NULL  -- counts the claims of the rig: the newest one holds
) STRICT;
