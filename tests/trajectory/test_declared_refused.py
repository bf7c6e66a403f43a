"""Via points, sinusoids, sequences and steps that cannot be: each with its line, and what would fix it."""

from __future__ import annotations

import numpy as np
import pytest
from samples.trajectories import (
    DWELL,
    FIRM,
    GO,
    HEAD,
    LASTING,
    ON,
    PUSH,
    SEQUENCE,
    SINUSOIDS,
    SOFTENING,
    STANDING,
    STEPS,
    SWINGING,
    VIA,
    load,
    problems,
)

pytestmark = pytest.mark.usefixtures("own_folder")


CASES = {
    "a point of another length": (
        LASTING + VIA.replace("[1, 0.1]", "[1, 0.1, 2]") + FIRM,
        "8: points: expected 2 values, one for each joint (arm, slide), found 3; is the file for another",
    ),
    "an unknown joint": (
        LASTING + VIA.replace("slide", "slid") + FIRM,
        "8: points: no joint is called 'slid'; did you mean 'slide'?",
    ),
    "degrees for a length": (
        LASTING + VIA.replace("slide: 0.2", "slide: 2 deg") + FIRM,
        "8: points: '2 deg' is an angle; expected a number in m",
    ),
    "no list of points": (
        LASTING + VIA.replace("[0, {", "{").replace(", [1, 0.1]]", "") + FIRM,
        "8: points: expected a list",
    ),
    "one point": (
        LASTING + "position: {type: via, degree: 7, points: [0]}\n" + FIRM,
        "5: position: points: expected 2 to 1000",
    ),
    "too many points": (
        LASTING + f"position: {{type: via, degree: 7, points: [{'0, 1, ' * 500} 0]}}\n" + FIRM,
        "5: position: points: expected 2 to 1000 points, found 1001",
    ),
    "a point twice without times": (
        LASTING + VIA.replace("{arm: 60 deg, slide: 0.2}", "{arm: 0, slide: 0}") + FIRM,
        "8: position: points: point 2 is the one before again; give times to pass it twice",
    ),
    "too low a degree": (
        LASTING + VIA.replace("7", "5") + FIRM,
        "7: degree: must be odd, from 7 to 9 (derivatives up to the third must vanish at both ends), not ",
    ),
    "too few times": (
        HEAD + VIA + "  times: [0, 1]\n" + FIRM,
        "7: position: times: expected 3, one for each point, found 2",
    ),
    "a first time that is not zero": (
        HEAD + VIA + "  times: [1, 2, 3]\n" + FIRM,
        "7: position: times: the first must be 0, not 1: it counts from the start",
    ),
    "times that stand still": (
        HEAD + VIA + "  times: [0, 2, 2]\n" + FIRM,
        "7: position: times: must increase strictly, but 2 follows 2",
    ),
    "another duration": (
        LASTING + VIA + "  times: [0, 1, 3]\n" + FIRM,
        "5: position: lasts 3 s, but the trajectory 4 s",
    ),
    "two durations": (
        HEAD + VIA + "  times: [0, 1, 3]\n" + SOFTENING + "  times: [0, 1, 2]\n",
        "8: stiffness: lasts 2 s, but the trajectory 3 s",
    ),
    "no duration": (HEAD + VIA + FIRM, "1: missing key 'duration' (s)"),
    "points too near in time": (
        HEAD + VIA + "  times: [0, 1e-7, 4]\n" + FIRM,
        "3: position: the points are too unevenly spaced in time for a spline of degree 7; space them",
    ),
    "huge points": (
        LASTING + "position: {type: via, degree: 7, points: [-1e308, 1e308, 0]}\n" + FIRM,
        "5: points of joint arm: must be at most 1e+30 in size, not -1e+308",
    ),
    "huge times": (
        HEAD + "rate: 1e-30\n" + VIA + "  times: [0, 1e30, 1.5e30]\n" + FIRM,
        "8: times: must be at most 1e+30 in size, not 1.5e+30",
    ),
    "a stiffness that is not positive": (
        LASTING + STANDING + SOFTENING.replace("900,", "-900,"),
        "9: points of joint arm: must be positive, not -900",
    ),
    "a stiffness that does not stay positive": (
        LASTING
        + STANDING
        + SOFTENING.replace("[900, 8000]", "[900, 8000], [10, 8000]")
        + "  times: [0, 1, 2, 4]\n",
        "9: stiffness.points of joint arm: the spline through them falls to -1009 after 1.534 s, but must",
    ),
    "no amplitudes": (LASTING + SINUSOIDS + FIRM, "5: position: missing key 'sine' or 'cosine' (amplitudes)"),
    "amplitudes that are no list": (
        LASTING + SINUSOIDS + "  sine: 1\n" + FIRM,
        "9: sine: expected a list with at least one entry, found '1'",
    ),
    "no frequency": (
        LASTING + SINUSOIDS.replace("0.5", "0") + "  sine: [1]\n" + FIRM,
        "7: frequency: must be positive, not 0",
    ),
    "too high a frequency": (
        LASTING + SINUSOIDS.replace("0.5", "1e29") + "  sine: [1]\n" + FIRM,
        "7: position.frequency: gives 4e+29 periods in 4 s; at most 1e+09 are possible",
    ),
    "too many harmonics": (
        LASTING + SINUSOIDS + f"  sine: [{'0, ' * 100} 1]\n" + FIRM,
        "9: position: sine: at most 100 harmonics are possible, not 101",
    ),
    "too long a ramp": (
        LASTING + SINUSOIDS + "  sine: [1]\n  ramp: 2.5\n" + FIRM,
        "10: position.ramp: must take at most half of the 4 s, not 2.5 s",
    ),
    "a stiffness that swings below zero": (
        LASTING + STANDING + SWINGING + "  sine: [{arm: 850, slide: 0}, 400]\n",
        "9: stiffness.offset of joint arm: the sum falls to -182.7 after 3.326 s, but must stay positive; "
        "take one above 1082.68, or smaller amplitudes",
    ),
    "a stiffness that swings to zero": (
        LASTING + STANDING + SWINGING + "  cosine: [[900, 0]]\n",
        "9: stiffness.offset of joint arm: the sum falls to 0 after 2.000 s, but must stay positive",
    ),
    "a stiffness that swings about zero": (
        LASTING + STANDING + SWINGING.replace("900", "0") + "  cosine: [[1, 0]]\n",
        "9: offset of joint arm: must be positive, not 0",
    ),
    "no start": (
        HEAD + SEQUENCE + DWELL + ON + FIRM,
        "7: position: parts: missing key 'start' (position at the start), since no part before says where",
    ),
    "nothing but dwells": (
        HEAD + SEQUENCE + DWELL + DWELL + FIRM,
        "5: position: parts: no part moves; take `type: constant`",
    ),
    "another start": (
        HEAD + SEQUENCE + GO + DWELL + GO + FIRM,
        "8: position: parts.start of joint arm: begins at 0, but the part before ends at 1; leave this key",
    ),
    "another first point": (
        HEAD + SEQUENCE + GO + "  - {type: via, degree: 9, points: [[1, 0.3], 0], duration: 1}\n" + FIRM,
        "7: position: parts.points of joint slide: begins at 0.3, but the part before ends at 0.2; begin",
    ),
    "a jump of the fourth derivative": (
        HEAD + SEQUENCE + GO.replace("9", "7") + DWELL + FIRM,
        "7: position: parts of joint arm: d4q jumps from -165.9 to 0 where this part begins; the motion must"
        " be four times continuously differentiable, so that parts meet at rest: take degree 9 or more",
    ),
    "sinusoids without a ramp": (
        HEAD
        + SEQUENCE
        + GO
        + "  - {type: sinusoids, duration: 1, frequency: 1, offset: [1, 0.2], sine: [0.1]}\n"
        + FIRM,
        "7: position: parts of joint arm: dq jumps from 0 to 0.6283 where this part begins; the motion",
    ),
    "a part of unknown type": (
        HEAD + SEQUENCE + GO.replace("polynomial", "polynom") + FIRM,
        "6: parts.type: unknown word 'polynom'; did you mean 'polynomial'?",
    ),
    "no parts": (
        HEAD + "position: {type: sequence, parts: []}\n" + FIRM,
        "3: parts: expected a list with at least one entry",
    ),
    "a part without duration": (
        HEAD + SEQUENCE + GO + "  - {type: via, degree: 9, points: [[1, 0.2], 0]}\n" + FIRM,
        "7: parts: missing key 'duration' or 'times' (s)",
    ),
    "a part with two durations": (
        HEAD
        + SEQUENCE
        + GO
        + "  - {type: via, degree: 9, points: [[1, 0.2], 0], duration: 2, times: [0, 1]}\n"
        + FIRM,
        "7: parts: duration: is 2 s, but the last of the times 1 s; leave it out",
    ),
    "a part of points too near in time": (
        HEAD + SEQUENCE + "  - {type: via, degree: 7, points: [0, 1, 2], times: [0, 1e-7, 1]}\n" + FIRM,
        "6: position: parts: the points are too unevenly spaced in time",
    ),
    "a part that lasts nothing beside the others": (
        HEAD + SEQUENCE + GO + DWELL.replace("0.7", "1e-30") + FIRM,
        "5: position: parts: durations from 1e-30 to 1.5 s cannot follow one another",
    ),
    "parts that last too long together": (
        HEAD + SEQUENCE + GO.replace("1.5", "1e30") + DWELL.replace("0.7", "1e30") + FIRM,
        "5: position: parts: durations from 1e+30 to 1e+30 s cannot follow one another",
    ),
    "a duration that is not that of the parts": (
        LASTING + SEQUENCE + GO + DWELL + FIRM,
        "5: position: lasts 2.2 s, but the trajectory 4 s",
    ),
    "too low a degree of steps": (
        LASTING + STANDING + STEPS.replace("5\n", "3\n") + "  times: [1, 2]\n  transition: 1\n",
        "8: degree: must be odd, from 5 to 15 (two derivatives must vanish where a change begins), not ",
    ),
    "a level that is not positive": (
        LASTING + STANDING + STEPS.replace("[900,", "[0,") + "  times: [1, 2]\n  transition: 1\n",
        "9: levels of joint arm: must be positive, not 0",
    ),
    "too few times of steps": (
        LASTING + STANDING + STEPS + "  times: [1]\n  transition: 1\n",
        "10: stiffness: times: expected 2, one for each level but the first, found 1",
    ),
    "steps that overlap": (
        LASTING + STANDING + STEPS + "  times: [1, 1.5]\n  transition: 1\n",
        "10: stiffness: times: 1.5 s is before the change that begins at 1 s ends, 1 s later",
    ),
    "steps beyond the end": (
        LASTING + STANDING + STEPS + "  times: [1, 3.5]\n  transition: 1\n",
        "10: stiffness.times: the last change ends at 4.5 s, the trajectory at 4 s",
    ),
    "a transition in no time": (
        LASTING + STANDING + STEPS + "  times: [1, 2]\n  transition: 1e-20\n",
        "6: stiffness: a profile must last a positive time (1e-30 to 1e+30 s), not from 1 to 1 s",
    ),
    "a wrench of other than six numbers": (
        LASTING + STANDING + FIRM + PUSH.replace(", 6]", "]") + "  times: [1]\n  transition: 1\n",
        "11: levels: expected 6 numbers in N (forces), N m (moments), found 5",
    ),
    "a polynomial of no duration": (
        HEAD + "duration: 1e-300\nposition: {type: polynomial, degree: 7, start: 0, end: 1}\n" + FIRM,
        "3: duration: must be at least 1e-30 in size, not 1e-300",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_it_is_refused_with_its_line(case):
    text, problem = CASES[case]
    found = problems(text)
    assert any(line.startswith(f"move.yaml:{problem}") for line in found), "\n".join(found)


def test_every_joint_that_begins_elsewhere_is_named_at_once():
    found = problems(HEAD + SEQUENCE + GO + GO + DWELL + FIRM)
    assert [line.partition(" begins")[0] for line in found] == [
        "move.yaml:7: position: parts.start of joint arm:",
        "move.yaml:7: position: parts.start of joint slide:",
    ]


@pytest.mark.parametrize(("duration", "rate"), [("1e-30", "1e30"), ("1e30", "1e-30")])
@pytest.mark.parametrize(
    "position", ["polynomial, degree: 15, start: 0, end: 1e30", "via, degree: 9, points: [-1e30, 1e30, 0]"]
)
def test_the_largest_numbers_have_derivatives(duration, rate, position):
    timing = f"duration: {duration}\nrate: {rate}\n"
    moving = load(HEAD + timing + f"position: {{type: {position}}}\n" + FIRM)
    block = moving.at(np.linspace(0, float(duration), 9))
    assert np.isfinite([block.q, block.dq, block.ddq, block.d3q, block.d4q]).all()
