-- The order of what devices report, and which events are of earlier rigs.

-- An event outlives its rig, and another rig may get the name: the events of the
-- name up to this one are of earlier rigs.
ALTER TABLE rigs ADD COLUMN earlier_events INTEGER NOT NULL DEFAULT 0;

CREATE TRIGGER rigs_know_earlier_events
AFTER INSERT ON rigs
BEGIN
  UPDATE rigs SET earlier_events =
    (SELECT coalesce(max(event), 0) FROM events WHERE rig = NEW.id)
  WHERE rig = NEW.rig;
END;

-- Of rigs from before: the last deletion that is an event of the name.
UPDATE rigs SET earlier_events = d.event
FROM (SELECT rig, max(event) AS event FROM events WHERE kind = 15 GROUP BY rig) d
WHERE d.rig = rigs.id;

-- On the device: the last place that was given in the outbox. No place is given
-- twice, as a report that is under way confirms notes by their places.
ALTER TABLE uplinks ADD COLUMN place INTEGER NOT NULL DEFAULT 0;

UPDATE uplinks SET place = coalesce(
  (SELECT max(o.place) FROM outbox o WHERE o.rig = uplinks.rig), 0);

-- On the device: counts the attempts to report the rig. On the hub: the newest
-- one that was taken; 0: the device does not count them.
ALTER TABLE uplinks ADD COLUMN attempt INTEGER NOT NULL DEFAULT 0;
ALTER TABLE reported_rigs ADD COLUMN attempt INTEGER NOT NULL DEFAULT 0;
