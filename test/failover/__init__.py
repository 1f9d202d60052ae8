"""The parts of ./test/fleet."""
