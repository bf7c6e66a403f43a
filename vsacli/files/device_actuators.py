"""Devices of the literature, whose actuators new robots can have, by the bundled robot that has each."""

from __future__ import annotations

from vsacli.base.errors import InputError

DEVICES = {
    "amasc": "coupled_1r",
    "awas_1r": "awas_1r",
    "awas_ii": "awas_ii",
    "bavs": "bavs",
    "compact": "compact_1r",
    "compact_vsa": "compact_vsa",
    "fsj": "fsj",
    "hasy_finger": "hand_tendon",
    "jack_spring": "jack_spring",
    "maccepa_1r": "maccepa_1r",
    "maccepa_2": "maccepa_2",
    "maccepa_vd": "maccepa_vd_1r",
    "qa_joint": "cam_1r",
    "qbmove": "qbmove_arm_manual",
    "qbmove_gazebo": "qbmove_arm_gazebo",
    "vs_joint": "vs_joint",
    "vsa_cubebot": "vsa_cubebot",
    "vsa_i": "coupled_1r",
    "vsa_ii": "vsa_ii",
    "vsaut_ii": "vsaut_ii",
}
"""Robot whose last joint has the device, by the word of the device."""

OF_DEVICE = ("actuator", "damper", "damping")
"""Keys of a joint that belong to the device."""


def check_drives(device: str, joint_type: str) -> None:
    """Raise an error unless a device drives joints of a type.

    Raises:
        InputError: without the name of the joint.
    """
    if joint_type != "revolute":
        raise InputError.one(f"{device} turns about an axis, and drives no {joint_type} joint")
