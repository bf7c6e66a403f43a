"""Mechanisms of one's own: the energy of the springs is written in the robot file."""
