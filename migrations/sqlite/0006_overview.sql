-- What lists of many rigs are sorted by, and events of one rig.

-- When the newest segment arrived; 0: none so far.
ALTER TABLE rigs ADD COLUMN last_seen_ns INTEGER NOT NULL DEFAULT 0;

UPDATE rigs SET last_seen_ns = coalesce(
  (SELECT receive_time_ns FROM segments WHERE segments.rig = rigs.rig
   ORDER BY sequence DESC LIMIT 1), 0);

CREATE INDEX rigs_by_last_seen ON rigs (last_seen_ns, id);

CREATE TRIGGER segments_tell_when_a_rig_was_seen
AFTER INSERT ON segments
BEGIN
  UPDATE rigs SET last_seen_ns = NEW.receive_time_ns
  WHERE rig = NEW.rig AND last_seen_ns < NEW.receive_time_ns;
END;

CREATE INDEX events_of_rig ON events (rig, event);
