"""Commented files to begin with, generated from the declarations."""

from vsacli.templates.robot import robot_template
from vsacli.templates.trajectory import trajectory_template

__all__ = ["robot_template", "trajectory_template"]
