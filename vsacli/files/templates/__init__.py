"""Commented files to begin with, generated from the declarations."""

from vsacli.files.templates.robot_template import robot_template
from vsacli.files.templates.trajectory_template import trajectory_template

__all__ = ["robot_template", "trajectory_template"]
