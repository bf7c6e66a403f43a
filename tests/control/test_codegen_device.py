"""Generated kernels on a GPU, where CuPy finds one, against the generated functions in C."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples.generated_code import Compiled, write_files
from samples.host_gpu import contiguous, exported, load_gpu_module
from samples.marks import needs_compiler
from samples.shipped import shipped_robot

from vsacli.control.codegen.feedback_function import feedback_linearization_function
from vsacli.control.codegen.project import generate, prefix_of
from vsacli.control.codegen.robot_functions import inverse_dynamics_function, link_torques_function
from vsacli.control.codegen.self_test import ReferenceResults

pytestmark = [needs_compiler, pytest.mark.slow]

OF_PEAK = 1e-12
"""Of a variable's peak: products and sums are contracted on a GPU; 2.3e-13 was seen."""


def cupy_with_device() -> Any:
    """CuPy; without it, or without a device, the test is skipped."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cupy = pytest.importorskip("cupy")
    try:
        cupy.cuda.runtime.getDeviceCount()
    except cupy.cuda.runtime.CUDARuntimeError as error:
        pytest.skip(str(error))
    return cupy


def assert_close(found: Any, expected: np.ndarray, name: str) -> None:
    """Arrays (..., samples) are those (samples, ...), to rounding."""
    values = np.moveaxis(np.asarray(found.get()), -1, 0)
    np.testing.assert_array_equal(np.isnan(values), np.isnan(expected), err_msg=name)
    there = np.isfinite(expected)
    peak = np.abs(expected[there]).max(initial=0)
    np.testing.assert_allclose(values[there], expected[there], rtol=0, atol=OF_PEAK * peak, err_msg=name)


@pytest.mark.parametrize("name", ["vsa_3r", "lwr_7r_vsa", "measured_1r"])
def test_a_gpu_computes_what_c_computes(name: str, tmp_path: Path) -> None:
    cupy = cupy_with_device()
    robot = shipped_robot(name)
    write_files(generate(robot), tmp_path)
    cpu = Compiled(tmp_path, prefix_of(robot))
    gpu = load_gpu_module(tmp_path, prefix_of(robot), cupy)
    for make in (link_torques_function, inverse_dynamics_function, feedback_linearization_function):
        function = make(robot)
        arguments = ReferenceResults(robot).inputs(function)
        expected, expected_flags = cpu(function, *arguments)
        for layout in (contiguous, dict):
            axis = -1 if layout is contiguous else 0
            found, flags = getattr(gpu, function.name)(*map(layout, arguments), sample_axis=axis)
            assert flags.get().tolist() == expected_flags
            for member, values in found.items():
                assert_close(values, expected[member], member)


@pytest.mark.parametrize("library", ["jax", "torch"])
def test_arrays_of_other_libraries_on_the_device(library: str, tmp_path: Path) -> None:
    cupy = cupy_with_device()
    robot = shipped_robot("tendon_1r")
    write_files(generate(robot), tmp_path)
    gpu = load_gpu_module(tmp_path, prefix_of(robot), cupy)
    function = inverse_dynamics_function(robot)
    (command,) = map(contiguous, ReferenceResults(robot).inputs(function))
    expected, _ = gpu.inverse_dynamics(command)
    given = {name: exported(library, cupy.asarray(values)) for name, values in command.items()}
    found, _ = gpu.inverse_dynamics(given)
    for member, values in found.items():
        np.testing.assert_array_equal(values.get(), expected[member].get())
    back = cupy.from_dlpack(exported(library, found["tau_motor"]))
    assert back.data.ptr == found["tau_motor"].data.ptr
