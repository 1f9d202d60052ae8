-- On the hub: rigs that their devices have deleted. A report from before, which
-- comes late, must not bring one back. Rows are removed after some days.
CREATE TABLE ended_reports (
  device BIGINT PRIMARY KEY,  -- key of the rig in the database of the device
  attempt BIGINT NOT NULL,  -- the one that told of the deletion
  time_ns BIGINT NOT NULL  -- when it came
);

CREATE INDEX ended_reports_by_time ON ended_reports (time_ns);
