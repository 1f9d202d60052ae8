-- When the rules about time look at a rig next (server/store/rig_checks.h), so
-- that they read no others. Every rig is looked at once after this migration,
-- but those that devices report: these look at their rigs themselves.
ALTER TABLE rigs ADD COLUMN session_check_ns INTEGER NOT NULL DEFAULT 0;
-- NULL: the policy of the rig has no rule about time.
ALTER TABLE rigs ADD COLUMN time_check_ns INTEGER DEFAULT 0;

UPDATE rigs SET session_check_ns = 9223372036854775807, time_check_ns = NULL
WHERE rig IN (SELECT rig FROM reported_rigs);

CREATE INDEX rigs_by_session_check ON rigs (session_check_ns);
CREATE INDEX rigs_by_time_check ON rigs (time_check_ns);
