-- The segments of a rig by score and by temperature.

CREATE INDEX scores_by_entropy_of_rig
  ON segment_scores (rig, group_name, entropy, sequence);

CREATE INDEX scores_by_gain_of_rig
  ON segment_scores (rig, group_name, gain, sequence);

CREATE INDEX segments_by_temperature ON segments (rig, temperature_c, sequence);
