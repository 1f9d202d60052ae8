-- The rights of database roles in the views fleet_rigs, fleet_labels and
-- fleet_estimates: a role sees the rigs of its labels, and no others.

-- The role sees the rigs with the label name = value. An empty name: all rigs.
CREATE TABLE fleet_readers (
  role TEXT COLLATE "C" NOT NULL,
  name TEXT COLLATE "C" NOT NULL,
  value TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (role, name, value),
  CHECK (name <> '' OR value = '')
);

-- Rows of fleet_readers for the present role and for the roles whose privileges
-- it has. Whoever may read the table rigs sees all rigs: the owner of the
-- tables, members of that role, and superusers. The table is a constant here;
-- its name would be looked up in the schemas of the reader.
CREATE VIEW reader_labels AS
SELECT f.name, f.value
FROM fleet_readers f JOIN pg_roles p ON p.rolname = f.role
WHERE pg_has_role(p.oid, 'USAGE')
UNION ALL
SELECT '', '' WHERE has_table_privilege(CAST('rigs' AS regclass), 'SELECT');

CREATE VIEW reader_sees_all AS
SELECT EXISTS (SELECT 1 FROM reader_labels WHERE name = '') AS sees_all;

-- The rigs that the present role sees because of their labels; none if it sees
-- all. OFFSET 0 keeps the planner from reading the labels of all rigs: it does
-- not know how few labels a role has.
CREATE VIEW reader_rigs AS
SELECT l.rig
FROM reader_labels f CROSS JOIN LATERAL (
  SELECT rig FROM rig_labels WHERE name = f.name AND value = f.value OFFSET 0) l
WHERE NOT (SELECT sees_all FROM reader_sees_all);

-- The content of the three views for all rigs, with the key of the rig. Nobody
-- but the owner may read them.
CREATE VIEW every_rig AS
SELECT r.rig AS key, r.id AS rig,
  CAST(r.create_time_ns AS DOUBLE PRECISION) / 1e9 AS created_s,
  CAST(r.last_seen_ns AS DOUBLE PRECISION) / 1e9 AS last_seen_s,
  r.alarms <> 0 AS has_alarms,
  (SELECT c.version FROM calibrations c
   WHERE c.rig = r.rig AND c.state = 1) AS active_version,
  (SELECT CAST(p.time_ns AS DOUBLE PRECISION) / 1e9 FROM reported_rigs p
   WHERE p.rig = r.rig) AS last_report_s
FROM rigs r;

CREATE VIEW every_label AS
SELECT r.rig AS key, r.id AS rig, l.name, l.value
FROM rig_labels l JOIN rigs r ON r.rig = l.rig;

CREATE VIEW every_estimate AS
SELECT r.rig AS key, r.id AS rig, e.version, e.component, e.unit, e.value,
  e.sigma, e.from_factory,
  CAST(c.create_time_ns AS DOUBLE PRECISION) / 1e9 AS created_s,
  c.state = 1 AS is_active,
  c.state = 3 AS is_rejected
FROM estimates e
JOIN calibrations c ON c.rig = e.rig AND c.version = e.version
JOIN rigs r ON r.rig = e.rig;

-- Each view has two branches, of which one is executed: the planner orders the
-- joins for all rigs in one, and for those of a few labels in the other. The
-- union stays within a subquery. PostgreSQL merges a union that is itself the
-- body of a view into the query of the reader, and a function of the reader
-- would then see the rows of all rigs in spite of security_barrier.
CREATE OR REPLACE VIEW fleet_rigs WITH (security_barrier) AS
SELECT rig, created_s, last_seen_s, has_alarms, active_version, last_report_s
FROM (
  SELECT * FROM every_rig WHERE (SELECT sees_all FROM reader_sees_all)
  UNION ALL
  SELECT * FROM every_rig WHERE key IN (SELECT rig FROM reader_rigs)) seen;

CREATE OR REPLACE VIEW fleet_labels WITH (security_barrier) AS
SELECT rig, name, value
FROM (
  SELECT * FROM every_label WHERE (SELECT sees_all FROM reader_sees_all)
  UNION ALL
  SELECT * FROM every_label WHERE key IN (SELECT rig FROM reader_rigs)) seen;

CREATE OR REPLACE VIEW fleet_estimates WITH (security_barrier) AS
SELECT rig, version, component, unit, value, sigma, from_factory, created_s,
  is_active, is_rejected
FROM (
  SELECT * FROM every_estimate WHERE (SELECT sees_all FROM reader_sees_all)
  UNION ALL
  SELECT * FROM every_estimate
  WHERE key IN (SELECT rig FROM reader_rigs)) seen;

-- Roles that may read the views, or views that are made of them, go on seeing
-- what they saw. A grant to PUBLIC is one to each role that can log in.
WITH RECURSIVE exposed (view) AS (
  SELECT oid FROM pg_class WHERE oid IN (CAST('fleet_rigs' AS regclass),
    CAST('fleet_labels' AS regclass), CAST('fleet_estimates' AS regclass))
  UNION
  SELECT w.ev_class
  FROM exposed e
  JOIN pg_depend d ON d.refclassid = CAST('pg_class' AS regclass)
    AND d.refobjid = e.view AND d.classid = CAST('pg_rewrite' AS regclass)
  JOIN pg_rewrite w ON w.oid = d.objid
),
grants (acl) AS (
  SELECT c.relacl FROM exposed e JOIN pg_class c ON c.oid = e.view
  UNION ALL
  SELECT a.attacl FROM exposed e JOIN pg_attribute a ON a.attrelid = e.view
)
INSERT INTO fleet_readers (role, name, value)
SELECT DISTINCT p.rolname, '', ''
FROM grants
CROSS JOIN LATERAL aclexplode(grants.acl) g
JOIN pg_roles p
  ON p.oid = g.grantee OR (g.grantee = 0 AND p.rolcanlogin)
WHERE g.privilege_type = 'SELECT'
  AND NOT has_table_privilege(p.oid, CAST('rigs' AS regclass), 'SELECT');
