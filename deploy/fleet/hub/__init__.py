"""What deploy/fleet's programs share."""
