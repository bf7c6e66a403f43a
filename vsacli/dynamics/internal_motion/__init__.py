"""What moves inside transmissions with a damper: states of the inverse, integrated along a trajectory."""

from vsacli.dynamics.internal_motion.solution import (
    InternalMotions,
    damped_joints,
    internal_motions,
    refuse_damped_transmissions,
)

__all__ = ["InternalMotions", "damped_joints", "internal_motions", "refuse_damped_transmissions"]
