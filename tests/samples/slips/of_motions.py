"""Slips of units of motions, limits of joints' motion, stamps and wrenches."""

from samples.slips.slip import Slip

TYPICAL: list[Slip] = [
    Slip("degrees as end", "vsa_3r", "rest_to_rest",
        {"end: [90 deg, 45 deg, -60 deg]": "end: [90, 45, -60]"},
        "positions of revolute joints", "end.base", "90 deg"),
    Slip("degrees as start", "vsa_3r", "rest_to_rest",
        {"start: 0  ": "start: -30  "}, "positions of revolute joints", "position.start", "-30 deg"),
    Slip("degrees as limits", "rp_2", "rp_2",
        {"[-90 deg, 90 deg]": "[-90, 90]"}, "ranges of revolute joints", "position.0", "-90 deg"),
    Slip("degrees as limit of both sides", "scara_4", "scara_4",
        {"position: 145 deg": "position: 145"}, "ranges of revolute joints", "limits.position", "145 deg"),
    Slip("deg/s as velocity", "panda_7r", "panda_7r",
        {"velocity: 2.175": "velocity: 125"},
        "velocities of revolute joints", "limits.velocity", "125 deg/s"),
    Slip("mm as stroke", "rp_2", "rp_2",
        {"slide: 0.20}": "slide: 200}", "position: [0, 0.30]": "position: [0, 300]"},
        "ranges of prismatic joints", "position.1", "300 mm"),
    Slip("mm as prismatic end", "rp_2", "rp_2",
        {"slide: 0.20}": "slide: 200}"}, "positions of prismatic joints", "end.slide", "200 mm"),
    Slip("mm/s as velocity", "scara_4", "scara_4",
        {"velocity: 0.9}": "velocity: 900}"},
        "velocities of prismatic joints", "limits.velocity", "900 mm/s"),
    Slip("ms as duration", "vsa_3r", "rest_to_rest",
        {"duration: 4.0": "duration: 4000"}, "slow motions", "duration", "4000 ms"),
    Slip("kHz as rate", "vsa_3r", "rest_to_rest",
        {"rate: 1000": "rate: 1"}, "numbers of samples", "rate", "1 kHz"),
    Slip("a period as rate", "vsa_3r", "rest_to_rest",
        {"rate: 1000": "rate: 0.001"}, "numbers of samples", "rate", ""),
]  # fmt: skip

FURTHER: list[Slip] = [
    Slip("degrees of via points", "vsa_3r", "vsa_3r_via",
        {"[60 deg, 20 deg, -50 deg]": "[60, 20, -50]"},
        "positions of revolute joints", "points.2.base", "60 deg"),
    Slip("degrees of amplitudes", "vsa_3r", "vsa_3r_excitation",
        {"[0.30, 0.15, -0.20]": "[17, 8.6, -11]"}, "positions of revolute joints", "sine.0.base", "17 deg"),
    Slip("ms as times", "vsa_3r", "vsa_3r_via",
        {"times: [0, 1.6, 2.8, 4.5]": "times: [0, 1600, 2800, 4500]"}, "slow motions", "times.3", "4500 ms"),
    Slip("a period as frequency", "vsa_3r", "vsa_3r_excitation",
        {"frequency: 1/8": "frequency: 8"}, "accelerations of sinusoids", "frequency", "8 rad/s"),
    Slip("minutes as duration", "vsa_3r", "rest_to_rest",
        {"duration: 4.0": "duration: 0.0667"}, "accelerations", "duration", "0.0667 min"),
    Slip("kN as force", "vsa_3r", "vsa_3r_pick_and_place",
        {"-4.905": "-0.004905"}, "forces on the end effector", "levels.1.2", "-0.004905 kN"),
]  # fmt: skip

REST: list[Slip] = [
    Slip("ms as duration of a short motion", "devices/vsa_ii", "devices/vsa_ii",
        {"duration: 1.5": "duration: 1000"}, "motions slow for the motors", "duration", "1000 ms"),
    Slip("N mm as moment", "vsa_3r", "vsa_3r_pick_and_place",
        {"[0, 0, -4.905, 0, 0, 0]": "[0, 0, -4.905, 0, 0, 2000]"},
        "moments on the end effector", "levels.1.5", "2000 N mm"),
]  # fmt: skip
