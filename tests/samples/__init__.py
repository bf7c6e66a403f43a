"""Robots, trajectories and files that tests of several rooms share."""
