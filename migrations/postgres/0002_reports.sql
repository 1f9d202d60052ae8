-- Records of what a device reports to its hub: the same as ../sqlite has. The
-- device counts the reports of each rig; the hub knows the number of the last
-- one, so that it notices a gap.

-- On the device: the rigs that it reports.
CREATE TABLE uplinks (
  rig BIGINT PRIMARY KEY,  -- it may be deleted: then the hub is told
  id TEXT COLLATE "C" NOT NULL,  -- name of the rig
  report BIGINT NOT NULL DEFAULT 0,  -- the last that the hub acknowledged
  time_ns BIGINT NOT NULL DEFAULT 0,  -- when; 0: none so far
  deleted BIGINT NOT NULL DEFAULT 0,
  -- Data of segments that is reported: none, what is kept, all.
  data BIGINT NOT NULL DEFAULT 0 CHECK (data IN (0, 1, 2))
);

-- On the device: which records have changed since the hub was told, in the
-- order in which they first did. A report has a record as it is then.
CREATE TABLE outbox (
  rig BIGINT NOT NULL REFERENCES uplinks,
  place BIGINT NOT NULL,  -- counts from 1 in a rig
  kind BIGINT NOT NULL CHECK (kind >= 1),  -- RecordKind
  number BIGINT NOT NULL,  -- of the record among those of its kind
  revision BIGINT NOT NULL,  -- counts its changes while it waits
  PRIMARY KEY (rig, place),
  UNIQUE (rig, kind, number)
);

-- On the hub: the rigs that devices report.
CREATE TABLE reported_rigs (
  rig BIGINT PRIMARY KEY REFERENCES rigs,
  device BIGINT NOT NULL,  -- key of the rig in the database of the device
  report BIGINT NOT NULL,  -- the last that was taken
  time_ns BIGINT NOT NULL,  -- when
  waiting BIGINT NOT NULL,  -- records that were still to be reported then
  program_version TEXT COLLATE "C" NOT NULL  -- of the device
);

-- On the hub: what the devices of rigs are to do.
CREATE TABLE instructions (
  rig BIGINT NOT NULL REFERENCES rigs,
  instruction BIGINT NOT NULL,  -- counts from 1 in a rig
  create_time_ns BIGINT NOT NULL,
  caller TEXT COLLATE "C" NOT NULL,
  request BYTEA NOT NULL,  -- selfcal.v1.Instruction with its request alone
  sha256 BYTEA NOT NULL,
  state BIGINT NOT NULL CHECK (state IN (1, 2, 3)),  -- pending done refused
  message TEXT COLLATE "C" NOT NULL DEFAULT '',
  end_time_ns BIGINT NOT NULL DEFAULT 0,
  PRIMARY KEY (rig, instruction)
);
