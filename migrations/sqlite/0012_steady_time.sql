-- Steady time: the wall clock without its jumps. Ages are differences of it. What
-- was stored before has the time of the wall clock.

ALTER TABLE segments ADD COLUMN steady_ns INTEGER NOT NULL DEFAULT 0;
UPDATE segments SET steady_ns = receive_time_ns;

ALTER TABLE runs ADD COLUMN create_steady_ns INTEGER NOT NULL DEFAULT 0;
ALTER TABLE runs ADD COLUMN end_steady_ns INTEGER NOT NULL DEFAULT 0;
UPDATE runs SET create_steady_ns = create_time_ns, end_steady_ns = end_time_ns;

ALTER TABLE calibrations ADD COLUMN create_steady_ns INTEGER NOT NULL DEFAULT 0;
UPDATE calibrations SET create_steady_ns = create_time_ns;

DROP TRIGGER calibrations_never_change;
CREATE TRIGGER calibrations_never_change
BEFORE UPDATE OF rig, version, create_time_ns, create_steady_ns, run, content,
  sha256
ON calibrations
BEGIN
  SELECT RAISE(ABORT, 'a calibration version never changes');
END;

DROP TRIGGER activations_never_change;
ALTER TABLE activations ADD COLUMN steady_ns INTEGER NOT NULL DEFAULT 0;
UPDATE activations SET steady_ns = time_ns;
CREATE TRIGGER activations_never_change
BEFORE UPDATE ON activations
BEGIN
  SELECT RAISE(ABORT, 'an activation never changes');
END;

-- One row: the clocks of the device at one moment, from which steady time
-- continues.
CREATE TABLE clock (
  clock INTEGER PRIMARY KEY CHECK (clock = 1),
  boot TEXT NOT NULL,  -- names the time since the machine was booted
  since_boot_ns INTEGER NOT NULL,
  time_ns INTEGER NOT NULL,
  steady_ns INTEGER NOT NULL,
  keep_until_ns INTEGER NOT NULL  -- nothing is removed for its age before this
) STRICT;
