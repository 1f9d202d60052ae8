-- Lists of many rigs: their segments by arrival and by gain, and the rigs with a
-- label.

CREATE INDEX segments_by_time ON segments (steady_ns, rig, sequence);

CREATE INDEX scores_by_gain
  ON segment_scores (group_name, gain, rig, sequence);

CREATE INDEX rigs_by_label ON rig_labels (name, value, rig);
