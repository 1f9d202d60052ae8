-- Records of what a device reports to its hub. The device counts the reports of
-- each rig; the hub knows the number of the last one, so that it notices a gap.

-- On the device: the rigs that it reports.
CREATE TABLE uplinks (
  rig INTEGER PRIMARY KEY,  -- it may be deleted: then the hub is told
  id TEXT NOT NULL,  -- name of the rig
  report INTEGER NOT NULL DEFAULT 0,  -- the last that the hub acknowledged
  time_ns INTEGER NOT NULL DEFAULT 0,  -- when; 0: none so far
  deleted INTEGER NOT NULL DEFAULT 0,
  -- Data of segments that is reported: none, what is kept, all.
  data INTEGER NOT NULL DEFAULT 0 CHECK (data IN (0, 1, 2))
) STRICT;

-- On the device: which records have changed since the hub was told, in the
-- order in which they first did. A report has a record as it is then.
CREATE TABLE outbox (
  rig INTEGER NOT NULL REFERENCES uplinks,
  place INTEGER NOT NULL,  -- counts from 1 in a rig
  kind INTEGER NOT NULL CHECK (kind >= 1),  -- RecordKind
  number INTEGER NOT NULL,  -- of the record among those of its kind
  revision INTEGER NOT NULL,  -- counts its changes while it waits
  PRIMARY KEY (rig, place),
  UNIQUE (rig, kind, number)
) STRICT, WITHOUT ROWID;

-- On the hub: the rigs that devices report.
CREATE TABLE reported_rigs (
  rig INTEGER PRIMARY KEY REFERENCES rigs,
  device INTEGER NOT NULL,  -- key of the rig in the database of the device
  report INTEGER NOT NULL,  -- the last that was taken
  time_ns INTEGER NOT NULL,  -- when
  waiting INTEGER NOT NULL,  -- records that were still to be reported then
  program_version TEXT NOT NULL  -- of the device
) STRICT;

-- On the hub: what the devices of rigs are to do.
CREATE TABLE instructions (
  rig INTEGER NOT NULL REFERENCES rigs,
  instruction INTEGER NOT NULL,  -- counts from 1 in a rig
  create_time_ns INTEGER NOT NULL,
  caller TEXT NOT NULL,
  request BLOB NOT NULL,  -- selfcal.v1.Instruction with its request alone
  sha256 BLOB NOT NULL,
  state INTEGER NOT NULL CHECK (state IN (1, 2, 3)),  -- pending done refused
  message TEXT NOT NULL DEFAULT '',
  end_time_ns INTEGER NOT NULL DEFAULT 0,
  PRIMARY KEY (rig, instruction)
) STRICT, WITHOUT ROWID;
