-- The steady time at which outdated scores of a rig are computed again, if
-- nobody has done so before (RigCheck::kScores of server/store/rig_checks.h).
-- NULL: none is outdated.
ALTER TABLE rigs ADD COLUMN score_check_ns INTEGER;

CREATE INDEX rigs_by_score_check ON rigs (score_check_ns)
  WHERE score_check_ns IS NOT NULL;
