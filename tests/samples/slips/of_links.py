"""Slips of units of links: lengths, masses, angles of the chain, gravity."""

from samples.slips.slip import Slip

TYPICAL: list[Slip] = [
    Slip("degrees as alpha", "vsa_3r", "rest_to_rest",
        {"alpha: pi/2": "alpha: 90"}, "fixed angles", "alpha", "90 deg"),
    Slip("degrees as theta", "rp_2", "rp_2",
        {"theta: 90 deg": "theta: 90"}, "fixed angles", "theta", "90 deg"),
    Slip("degrees as rpy", "vsa_3r", "rest_to_rest",
        {"joints:\n": "base: {rpy: [0, 180, 0]}\njoints:\n"}, "fixed angles", "base.rpy.1", "180 deg"),
    Slip("mm as a", "vsa_3r", "rest_to_rest",
        {"a: 0.30": "a: 300"}, "lengths", "dh.a", "300 mm"),
    Slip("mm as d", "ur5_6r", "ur5_6r",
        {"d: 0.089159": "d: 89.159"}, "lengths", "dh.d", "89.159 mm"),
    Slip("mm as center of mass", "vsa_3r", "rest_to_rest",
        {"[-0.15, 0, 0]": "[-150, 0, 0]"}, "lengths", "com.0", "-150 mm"),
    Slip("mm as tool", "panda_7r", "panda_7r",
        {"xyz: [0, 0, 0.107]": "xyz: [0, 0, 107]"}, "lengths", "tool.xyz.2", "107 mm"),
    Slip("g as mass", "vsa_3r", "rest_to_rest",
        {"mass: 6.7858": "mass: 6785.8"}, "densities of links", "mass", "6785.8 g"),
    Slip("g as all masses", "ur5_6r", "ur5_6r",
        {"mass: 3.7 ": "mass: 3700 ", "mass: 8.393 ": "mass: 8393 ", "mass: 2.33 ": "mass: 2330 "},
        "densities of links", "mass", "3700 g"),
    Slip("kg mm^2 as inertia", "vsa_3r", "rest_to_rest",
        {"xx: 0.0139, yy: 0.0578, zz: 0.0578": "xx: 13900, yy: 57800, zz: 57800"},
        "densities of links", "inertia", "kg mm^2"),
    Slip("g cm^2 as inertia", "qbmove_arm_manual", "qbmove_arm",
        {"xx: 2e-5, yy: 2.5e-4, zz: 2.5e-4": "xx: 200, yy: 2500, zz: 2500"},
        "densities of links", "inertia", "g cm^2"),
    Slip("gravity in mm/s^2", "vsa_3r", "rest_to_rest",
        {"gravity: [0, 0, -9.81]": "gravity: [0, 0, -9810]"}, "size of gravity", "gravity", "9810 mm/s^2"),
    Slip("gravity upwards", "vsa_3r", "rest_to_rest",
        {"gravity: [0, 0, -9.81]": "gravity: [0, 0, 9.81]"},
        "direction of gravity", "gravity", "the opposite sign"),
]  # fmt: skip

FURTHER: list[Slip] = [
    Slip("gravity as direction", "vsa_3r", "rest_to_rest",
        {"gravity: [0, 0, -9.81]": "gravity: [0, 0, -1]"}, "gravity as a direction", "gravity", ""),
    Slip("cm as lengths", "vsa_3r", "rest_to_rest",
        {"a: 0.30": "a: 30", "[-0.15, 0, 0]": "[-15, 0, 0]"}, "lengths", "dh.a", "30 cm"),
]  # fmt: skip

REST: list[Slip] = [
    Slip("center of mass beyond the tip", "vsa_3r", "rest_to_rest",
        {"com: [-0.15, 0, 0]": "com: [+0.15, 0, 0]"}, "centers of mass", "link.com", "the opposite sign"),
    Slip("gravity along all axes", "planar_2r", "planar_2r",
        {"gravity: [0, -9.81, 0]": "gravity: [0, 0, -9.81]"}, "load of gravity", "gravity", "turn it"),
    Slip("masses in g, inertias in g m^2", "tendon_1r", "tendon_1r",
        {"mass: 0.8 ": "mass: 800 ", "xx: 5e-4, yy: 4.5e-3, zz: 4.5e-3": "xx: 0.5, yy: 4.5, zz: 4.5"},
        "densities of links", "mass", "800 g"),
    Slip("inertia in kg cm^2 of a light link", "qbmove_arm_manual", "qbmove_arm",
        {"xx: 2e-5, yy: 2.5e-4, zz: 2.5e-4": "xx: 0.2, yy: 2.5, zz: 2.5"},
        "densities of links", "inertia", "kg cm^2"),
    Slip("lengths converted twice", "vsa_3r", "rest_to_rest",
        {"a: 0.30": "a: 0.0003", "[-0.15, 0, 0]": "[-0.00015, 0, 0]"}, "sizes of links", "mass", ""),
]  # fmt: skip
