-- The device's temperature while it recorded a segment, in degrees Celsius.

ALTER TABLE segments ADD COLUMN temperature_c REAL;  -- NULL: not known
