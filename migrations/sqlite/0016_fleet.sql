-- Lists over all rigs.

-- Alarms of a rig as bits (Alarm of server/domain/alarms.h): kept up to date by
-- each transaction, so that the rigs concerned are found
-- without reading the others. A rig from before has them with its next change.
ALTER TABLE rigs ADD COLUMN alarms INTEGER NOT NULL DEFAULT 0;

CREATE INDEX rigs_by_alarms ON rigs (alarms, id);

CREATE INDEX reported_rigs_by_time ON reported_rigs (time_ns);

CREATE INDEX runs_by_time ON runs (create_steady_ns, rig, run);

CREATE INDEX calibrations_by_time
  ON calibrations (create_steady_ns, rig, version);

-- The parameters of versions, one row each, to search and to plot by: as the
-- content of the version has them. Written with the version; for
-- those from before, later (CompleteEstimates of server/domain/domain.h).
CREATE TABLE estimates (
  rig INTEGER NOT NULL,
  version INTEGER NOT NULL,
  component TEXT NOT NULL,  -- e.g. cam0.focal.x
  unit TEXT NOT NULL,
  value REAL NOT NULL,
  sigma REAL,  -- NULL: not a number
  from_factory REAL,  -- difference; NULL: of other cameras
  PRIMARY KEY (rig, version, component),
  FOREIGN KEY (rig, version) REFERENCES calibrations
) STRICT, WITHOUT ROWID;

CREATE INDEX estimates_by_component ON estimates (component, rig, version);

-- For dashboards and other programs that read the database. These views stay as
-- they are when tables change.
CREATE VIEW fleet_rigs AS
SELECT r.id AS rig,
  CAST(r.create_time_ns AS REAL) / 1e9 AS created_s,
  CAST(r.last_seen_ns AS REAL) / 1e9 AS last_seen_s,
  r.alarms <> 0 AS has_alarms,
  (SELECT c.version FROM calibrations c
   WHERE c.rig = r.rig AND c.state = 1) AS active_version,
  (SELECT CAST(p.time_ns AS REAL) / 1e9 FROM reported_rigs p
   WHERE p.rig = r.rig) AS last_report_s
FROM rigs r;

CREATE VIEW fleet_labels AS
SELECT r.id AS rig, l.name, l.value
FROM rig_labels l JOIN rigs r ON r.rig = l.rig;

CREATE VIEW fleet_estimates AS
SELECT r.id AS rig, e.version, e.component, e.unit, e.value, e.sigma,
  e.from_factory,
  CAST(c.create_time_ns AS REAL) / 1e9 AS created_s,
  c.state = 1 AS is_active,
  c.state = 3 AS is_rejected
FROM estimates e
JOIN calibrations c ON c.rig = e.rig AND c.version = e.version
JOIN rigs r ON r.rig = e.rig;
