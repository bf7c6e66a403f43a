"""Base parameters of the links of a robot, without parameters of its joints."""

from __future__ import annotations

import numpy as np

from vsacli import Robot
from vsacli.studies.identification.regressor import (
    SYMBOLS,
    BaseParameters,
    preferred_order,
    random_motion,
    regressor,
)


def base_parameters(robot: Robot) -> BaseParameters:
    """The combinations of link parameters that torques tell."""
    joints = len(robot.joints)
    columns = np.moveaxis(regressor(robot, *random_motion(joints)), 1, -1)
    return BaseParameters.of_columns(columns.reshape(-1, len(SYMBOLS) * joints), preferred_order(joints))
