-- How well segments fit, which of a run's segments its result does not use, and
-- runs at the end of a session.

-- Root of what the squares of all whitened residuals keep, over their
-- expectation; 0: not measured, as for segments from before.
ALTER TABLE segments ADD COLUMN fit REAL NOT NULL DEFAULT 0;

-- Of a segment that does not fit, and the largest that did; NULL for other
-- causes. Causes since: does not fit, many outliers.
ALTER TABLE table_absences ADD COLUMN fit REAL;
ALTER TABLE table_absences ADD COLUMN fit_limit REAL;

-- 1: quarantined because of the result of the run, which does not use it.
ALTER TABLE run_segments ADD COLUMN excluded INTEGER NOT NULL DEFAULT 0;

-- 1, with cause 2: the tables have changed, and the session has ended.
ALTER TABLE runs ADD COLUMN session_ended INTEGER NOT NULL DEFAULT 0;
