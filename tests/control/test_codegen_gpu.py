"""Generated kernels for a GPU, run on the host as C++, against the generated functions in C."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.command_line import REPOSITORY
from samples.generated_code import write_files
from samples.host_gpu import (
    CUDARuntimeError,
    Foreign,
    HostEvent,
    HostProject,
    assert_equal,
    by_c,
    contiguous,
    exported,
    host_cupy,
    host_project,
    load_gpu_module,
)
from samples.marks import needs, needs_compiler, slow, slow_but
from samples.plants import all_rigid
from samples.shipped import shipped_robot
from samples.trees import random_tree

from vsacli import InputError, Robot
from vsacli.base.wrench import WrenchFrame
from vsacli.control.codegen.feedback_function import feedback_linearization_function
from vsacli.control.codegen.interface import Function
from vsacli.control.codegen.plant_functions import state_derivative_function
from vsacli.control.codegen.project import generate, prefix_of
from vsacli.control.codegen.robot_functions import inverse_dynamics_function, link_torques_function
from vsacli.control.codegen.self_test import Arrays, ReferenceResults

pytestmark = [needs_compiler, needs("g++", "g++")]

SMALL = "rp_2"
"""A robot whose project compiles in a moment."""

MAKERS = (
    link_torques_function,
    inverse_dynamics_function,
    feedback_linearization_function,
    state_derivative_function,
)

BUNDLED = sorted(
    str(path.relative_to(REPOSITORY / "robots").with_suffix(""))
    for path in (REPOSITORY / "robots").rglob("*.yaml")
)


def functions_of(robot: Robot, wrench: WrenchFrame | None) -> list[Function]:
    """The functions of a robot's project that are evaluated sample by sample."""
    functions = []
    for make in MAKERS:
        try:
            functions.append(make(robot, wrench))
        except InputError:  # no law for it
            continue
    return functions


def samples_of(
    robot: Robot, function: Function, precision: str = "double", wrench: WrenchFrame | None = None
) -> list[Arrays]:
    """Arguments, (samples, ...): those of the self-test, and the first one with a number that is none."""
    real = np.dtype("f4" if precision == "float" else "f8")
    arguments = ReferenceResults(robot, (), wrench).inputs(function)
    spoilt = [
        {name: np.concatenate([array, array[:3]]) for name, array in each.items()} for each in arguments
    ]
    for sample, value in zip((-1, -2, -3), (np.nan, np.inf, 1e200), strict=True):
        for arrays in spoilt[:1]:
            name = list(arrays)[sample % len(arrays)]
            arrays[name][sample].flat[0] = value
    with np.errstate(over="ignore"):
        return [{name: array.astype(real) for name, array in each.items()} for each in spoilt]


def check_functions(name: str, precision: str = "double", wrench: WrenchFrame | None = None) -> None:
    check_robot(shipped_robot(name), host_project(name, precision, wrench=wrench), precision, wrench)


def check_robot(
    robot: Robot, project: HostProject, precision: str = "double", wrench: WrenchFrame | None = None
) -> None:
    """Compare all functions of a robot."""
    for function in functions_of(robot, wrench):
        arguments = samples_of(robot, function, precision, wrench)
        structures = [structure.name for _, structure in function.arguments]
        expected, expected_flags = by_c(project, function.name, list(zip(structures, arguments, strict=True)))
        found, flags = getattr(project.gpu, function.name)(*map(contiguous, arguments))
        assert found.keys() == expected.keys()
        assert_equal(found, expected)
        np.testing.assert_array_equal(flags, expected_flags)


@pytest.mark.cases(4)
@pytest.mark.parametrize("name", slow_but({SMALL}, BUNDLED))
def test_kernels_are_the_functions_to_the_bit(name: str) -> None:
    check_functions(name)


@pytest.mark.slow
@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(21))
def test_kernels_of_random_robots(seed: int, tmp_path: Path) -> None:
    """Without springs, and with branches and every kind of actuator."""
    robot = random_tree(seed) if seed else all_rigid("RRR", seed=1)
    check_robot(robot, HostProject(tmp_path / "project", generate(robot), prefix_of(robot)))


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", slow_but({"tendon_1r"}, ["tendon_1r", "vsa_3r", "maccepa_vd_1r"]))
def test_kernels_in_single_precision(name: str) -> None:
    check_functions(name, "float")


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("name", "wrench"),
    [("tendon_1r", "base"), slow("lwr_7r_vsa", "end_effector"), slow("torso_2x3r", ("base", "end_effector"))],
)
def test_kernels_with_a_wrench(name: str, wrench: WrenchFrame) -> None:
    check_functions(name, wrench=wrench)


def command() -> tuple[Arrays, Arrays, Any]:
    """Commands of the small robot, (samples, ...), and their results in C."""
    robot = shipped_robot(SMALL)
    (arrays,) = samples_of(robot, inverse_dynamics_function(robot))
    return arrays, *by_c(host_project(SMALL), "inverse_dynamics", [("command", arrays)])


LAYOUTS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "fast": lambda array: np.ascontiguousarray(np.moveaxis(array, 0, -1)),
    "rows of samples": lambda array: np.moveaxis(array, 0, -1),
    "every third number": lambda array: np.moveaxis(array.repeat(3, axis=-1)[..., ::3], 0, -1),
    "backwards": lambda array: np.moveaxis(array[::-1].copy()[::-1], 0, -1),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_arrays_of_any_strides(layout: str) -> None:
    arrays, expected, _ = command()
    found, _ = host_project(SMALL).gpu.inverse_dynamics(
        {name: LAYOUTS[layout](array) for name, array in arrays.items()}
    )
    assert_equal(found, expected)


def test_samples_may_come_first() -> None:
    arrays, expected, flags = command()
    found, found_flags = host_project(SMALL).gpu.inverse_dynamics(arrays, sample_axis=0)
    assert_equal(found, expected)
    np.testing.assert_array_equal(found_flags, flags)


def test_what_all_samples_share_is_given_once() -> None:
    arrays, _, _ = command()
    shared = {
        **arrays,
        "stiffness": np.full_like(arrays["q"], 900.0),
        "dq": arrays["dq"][:1].repeat(len(arrays["q"]), 0),
    }
    expected, _ = by_c(host_project(SMALL), "inverse_dynamics", [("command", shared)])
    given = {**contiguous(arrays), "stiffness": 900, "dq": arrays["dq"][0]}
    found, _ = host_project(SMALL).gpu.inverse_dynamics(given)
    assert_equal(found, expected)


def test_only_the_results_that_are_wanted() -> None:
    arrays, expected, flags = command()
    found, found_flags = host_project(SMALL).gpu.inverse_dynamics(
        contiguous(arrays), results=("tau_motor", "flags")
    )
    assert found.keys() == {"tau_motor", "flags"}
    assert_equal(found, expected)
    np.testing.assert_array_equal(found_flags, flags)


def test_arguments_may_be_objects_and_results_lie_in_the_fast_layout() -> None:
    arrays, expected, _ = command()
    found, _ = host_project(SMALL).gpu.inverse_dynamics(type("Record", (), contiguous(arrays))())
    assert_equal(found, expected)
    assert all(array.flags["C_CONTIGUOUS"] for array in found.values())


def test_more_samples_than_threads_of_a_block() -> None:
    arrays, expected, _ = command()
    many = {name: np.concatenate([array] * 20) for name, array in arrays.items()}
    found, flags = host_project(SMALL).gpu.inverse_dynamics(contiguous(many), results=["tau_motor"])
    np.testing.assert_array_equal(
        np.moveaxis(np.asarray(found["tau_motor"]), -1, 0), np.concatenate([expected["tau_motor"]] * 20)
    )
    assert len(flags) == len(many["q"]) > 128


def test_no_samples() -> None:
    arrays, _, _ = command()
    found, flags = host_project(SMALL).gpu.inverse_dynamics(
        {name: contiguous(arrays)[name][..., :0] for name in arrays}
    )
    assert found["tau_motor"].shape == (2, 2, 0)
    assert len(flags) == 0


def test_parameters_are_one_set_or_one_a_sample() -> None:
    project = host_project(SMALL, patterns=("joints.*.link.mass",))
    arrays, _, _ = command()
    nominal = project.cpu.NOMINAL_PARAMETERS
    drawn = {name: nominal[name] * np.linspace(1, 1.2, len(arrays["q"])) for name in nominal.dtype.names}
    first, last = nominal.dtype.names[0], nominal.dtype.names[-1]
    cases: list[tuple[Any, Arrays]] = [
        (None, {}),
        ({last: 3.0}, {last: np.full(len(arrays["q"]), 3.0)}),
        ({first: drawn[first], last: 2}, {first: drawn[first], last: np.full(len(arrays["q"]), 2.0)}),
        (drawn, drawn),
    ]
    for given, values in cases:
        whole = {name: np.full(len(arrays["q"]), nominal[name]) for name in nominal.dtype.names} | values
        expected, _ = by_c(project, "inverse_dynamics", [("command", arrays), ("parameters", whole)])
        found, _ = project.gpu.inverse_dynamics(contiguous(arrays), given)
        assert_equal(found, expected)


def wrong(**changes: Any) -> Arrays:
    """A command of the small robot with other members; None removes one."""
    arrays = {**contiguous(command()[0]), **changes}
    return {name: array for name, array in arrays.items() if array is not None}


SAMPLES = 9
"""Number of samples of `command`."""

REFUSED: dict[str, tuple[type[Exception], str, Callable[[], dict[str, Any]]]] = {
    "single precision": (
        TypeError,
        r"command\.q is float32, but this code computes in float64: give float64, in JAX by jax_enable_x64, "
        r"in PyTorch by \.double\(\), or generate it with --precision float",
        lambda: {"command": wrong(q=np.zeros((2, SAMPLES), np.float32))},
    ),
    "an integer": (
        TypeError,
        r"command\.q is int64",
        lambda: {"command": wrong(q=np.zeros((2, SAMPLES), int))},
    ),
    "a shape": (
        ValueError,
        r"command\.q has the shape \(9, 2\), expected \(2,\) or \(2, samples\); "
        r"sample_axis=0 reads \(samples, 2\)",
        lambda: {"command": wrong(q=np.zeros((SAMPLES, 2)))},
    ),
    "a shape, samples first": (
        ValueError,
        r"command\.q has the shape \(2, 9\), expected \(2,\) or \(samples, 2\)$",
        lambda: {"command": wrong(), "sample_axis": 0},
    ),
    "too many axes": (
        ValueError,
        r"command\.q has the shape \(4, 2, 9\), expected",
        lambda: {"command": wrong(q=np.zeros((4, 2, SAMPLES)))},
    ),
    "numbers of samples": (
        ValueError,
        r"numbers of samples differ: command\.q has 8, command\.\w+ has 9",
        lambda: {"command": wrong(q=np.zeros((2, 8)))},
    ),
    "a missing member": (
        ValueError,
        r"command has q, dq, .*; expected q, dq, ddq, d3q, d4q, stiffness, dstiffness, ddstiffness",
        lambda: {"command": wrong(ddq=None)},
    ),
    "a member": (ValueError, "command has .* speed; expected", lambda: {"command": wrong(speed=np.zeros(2))}),
    "a result": (
        ValueError,
        "inverse_dynamics has no result torque; it has tau_e, phi, .*, tau_motor",
        lambda: {"command": wrong(), "results": ["torque"]},
    ),
    "an axis": (
        ValueError,
        "sample_axis is 1, expected 0 or -1",
        lambda: {"command": wrong(), "sample_axis": 1},
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_wrong_is_said(case: str) -> None:
    error, message, arguments = REFUSED[case]
    with pytest.raises(error, match=message):
        host_project(SMALL).gpu.inverse_dynamics(**arguments())


def test_an_unknown_parameter() -> None:
    project = host_project(SMALL, patterns=("joints.*.link.mass",))
    with pytest.raises(
        ValueError, match="no parameter mass; there are joints_0_link_mass, joints_1_link_mass"
    ):
        project.gpu.inverse_dynamics(wrong(), {"mass": 3})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The files of a project."""
    write_files(generate(shipped_robot(SMALL)), tmp_path)
    return tmp_path


def test_without_cupy_the_import_names_the_packages(folder: Path) -> None:
    with pytest.raises(
        ImportError, match=r"rp_2_gpu needs CuPy: pip install cupy-cuda13x .* cupy-cuda12x .*extras cuda13"
    ):
        load_gpu_module(folder, "rp_2", None)


def test_without_a_device_the_call_says_so(folder: Path) -> None:
    def count() -> int:
        raise CUDARuntimeError("no CUDA-capable device is detected")

    cupy = host_cupy()
    cupy.cuda.runtime.getDeviceCount = count
    module = load_gpu_module(folder, "rp_2", cupy)
    with pytest.raises(
        RuntimeError, match=r"no CUDA device \(no CUDA-capable .*rp_2\.py computes on the processor"
    ):
        module.inverse_dynamics(wrong())


@pytest.mark.parametrize("library", ["numpy", "jax", "torch"])
def test_arrays_of_other_libraries_and_back(library: str) -> None:
    """Those of the host are copied to the device; here both are the same."""
    arrays, expected, _ = command()
    given = {name: exported(library, array) for name, array in contiguous(arrays).items()}
    found, _ = host_project(SMALL).gpu.inverse_dynamics(given)
    assert_equal(found, expected)
    back = exported(library, found["tau_motor"])
    np.testing.assert_array_equal(np.asarray(back), found["tau_motor"])


def test_lists_and_arrays_of_cupy() -> None:
    arrays, expected, _ = command()
    given = {name: host_cupy().asarray(array) for name, array in contiguous(arrays).items()}
    found, _ = host_project(SMALL).gpu.inverse_dynamics({**given, "q": np.asarray(given["q"]).tolist()})
    assert_equal(found, expected)


def test_single_precision_of_jax_is_refused() -> None:
    jax = pytest.importorskip("jax")
    single = {
        name: jax.numpy.zeros(array.shape, "float32") for name, array in contiguous(command()[0]).items()
    }
    with pytest.raises(TypeError, match=r"is float32, .* in JAX by jax_enable_x64"):
        host_project(SMALL).gpu.inverse_dynamics(single)


def test_arrays_on_the_device_are_read_in_place_and_kept_until_they_are_read() -> None:
    arrays, expected, _ = command()
    given = contiguous(arrays)
    project = host_project(SMALL)
    event = HostEvent(disable_timing=True)
    event.done = False
    before, project.gpu.cupy.cuda.Event = HostEvent, lambda **_: event
    try:
        found, _ = project.gpu.inverse_dynamics({**given, "q": Foreign(given["q"])})
        assert_equal(found, expected)
        ((_, (kept,)),) = project.gpu._KEPT
        assert np.shares_memory(kept, given["q"])
        event.done = True
        project.gpu.inverse_dynamics(given)
        assert project.gpu._KEPT == []
    finally:
        project.gpu.cupy.cuda.Event = before
