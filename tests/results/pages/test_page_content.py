"""What a page holds: every variable with its numbers, limits, corridor, stretches; and nothing that acts."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from samples.command_line import REPOSITORY, ROBOT, edited, rest_to_rest
from samples.marks import slow_but
from samples.pages import Page
from samples.wicked import TEXTS, clean

from vsacli import load_robot
from vsacli.base.flags import FLAG_BITS
from vsacli.base.simulation_variables import SIMULATED_NAMES, SIMULATION_VARIABLES
from vsacli.base.variables import VARIABLES
from vsacli.cli.main import run
from vsacli.results.charts.figures import result_title
from vsacli.results.charts.reduction import FULL_DETAIL
from vsacli.results.charts.stored import STIFFNESS_BOUNDS
from vsacli.results.pages.result_page import sections_of
from vsacli.results.store.reader import StoredResult, open_stored

SINGLE = 2**-23
"""Half of the spacing of single precision, twice: numbers are rounded once, and times once more."""


def page_of(vsacli: Any, *files: Any) -> Page:
    done = vsacli("plot", *files, "--format", "html", "-o", "pages", "--overwrite")
    assert done.code == 0, done.err
    return Page(Path(done.err.removeprefix("wrote ").strip()))


@pytest.fixture(scope="module")
def page(feasible_result: Path, tmp_path_factory: pytest.TempPathFactory) -> Page:
    folder = tmp_path_factory.mktemp("page")
    assert run(["plot", str(feasible_result), "--format", "html", "-o", str(folder), "-q"]) == 0
    return Page(folder / "result.html")


def test_a_page_says_verdict_and_report_before_anything_else(page: Page) -> None:
    body = page.text[page.text.index("vsa-3r, rest-to-rest; 401 samples, 0 to 4 s") :]
    assert re.match(r"vsa-3r, rest-to-rest; 401 samples, 0 to 4 s\s*ok\s*Report\s*joint", body)
    assert body.index("self-check passed") < body.index("Inputs and provenance")


@pytest.mark.slow
def test_headings_are_the_titles_of_figures(vsacli: Any, tmp_path: Path, feasible_result: Path) -> None:
    """Of simulations with controller and model error; of several files with what distinguishes them."""
    motion = edited(rest_to_rest(tmp_path / "m.yaml"), tmp_path / "short.yaml", ("rate: 100 ", "rate: 10 "))
    assert vsacli("simulate", ROBOT, motion, "--perturb", "5%", "-o", "sim.h5", "-q").code in (0, 3)
    with open_stored("sim.h5") as simulation:
        title = result_title(simulation)
    assert title == "vsa-3r, rest-to-rest: simulation, feedforward, model error 5 %"
    page = page_of(vsacli, "sim.h5")
    assert f"{title}; 41 samples, 0 to 4 s" in page.text
    assert page.text.lstrip().startswith(title)  # of the window
    shutil.copy(feasible_result, "again.h5")
    both = page_of(vsacli, feasible_result, "again.h5").text
    for stem in (feasible_result.stem, "again"):
        assert f"vsa-3r, rest-to-rest ({stem}); 401 samples" in both


def test_provenance_is_in_words(vsacli: Any, motion: Path) -> None:
    assert vsacli("invdyn", ROBOT, motion, "--set", "rate=50", "-o", "set.h5", "-q").code == 0
    text = page_of(vsacli, "set.h5").text
    assert re.search(r"--set\s*\S*move.yaml: rate = 50\s", text)
    assert "stop_on_infeasible = false, min_margin = 0.01" in text


@pytest.mark.slow
def test_findings_come_before_the_table_and_values_after_it(vsacli: Any, too_soft: Path) -> None:
    assert vsacli("invdyn", ROBOT, too_soft, "-o", "soft.h5").code == 3
    page = page_of(vsacli, "soft.h5")
    classes = [attributes.get("class") for _, attributes in page.tags]
    assert classes.index("findings") < classes.index("joints") < classes.index("lines")
    finding, table = page.text.index("is below the minimum of"), page.text.index("peak tau_e")
    assert finding < table < page.text.index("initial torque discontinuity: ")


def test_every_curve_of_a_page_is_that_of_the_file(page: Page, feasible_result: Path) -> None:
    """Runs of so few steps are drawn as they are."""
    drawn = set()
    with h5py.File(feasible_result) as file:
        assert len(file["time"]) < FULL_DETAIL
        for chart in page.charts:
            for series in chart["series"]:
                motor = re.search(r"motor (\d)$", chart["title"])
                index = (series["joint"], int(motor[1]) - 1) if motor else (series["joint"],)
                stored = file[chart["name"]][(slice(None), *index)]
                np.testing.assert_allclose(page.array(series["values"]), stored, rtol=SINGLE, atol=0)
                np.testing.assert_allclose(page.array(series["time"]), file["time"], rtol=SINGLE, atol=0)
                drawn.add((chart["name"], *index))
        wanted = {
            (name, *index)
            for name in file
            if name
            not in ("flags", "inputs", "joint", "joint_type", "motor", "report", "time", *STIFFNESS_BOUNDS)
            for index in np.ndindex(file[name].shape[1:])
        }
    assert drawn == wanted


def test_every_variable_has_a_place_on_pages() -> None:
    for declared in (VARIABLES, SIMULATION_VARIABLES):
        names = [name for section in sections_of(list(declared)) for name in section.names]
        assert len(names) == len(set(names))
        own = {SIMULATED_NAMES.get(name, name) for name in declared if not name.endswith("_std")}
        assert set(names) == own - {*FLAG_BITS, *STIFFNESS_BOUNDS}


def test_stiffness_is_drawn_inside_what_can_be_reached(page: Page, feasible_result: Path) -> None:
    chart = page.chart("stiffness", "elbow")
    [series] = chart["series"]
    lower, upper = map(page.array, series["band"])
    with h5py.File(feasible_result) as file:
        np.testing.assert_allclose(lower, file["stiffness_min"][:, 2], rtol=SINGLE)
    bottom, top = chart["shown"]
    assert np.all(upper > top)  # cubic springs become as stiff as one likes
    assert bottom < 800 < 1275 < top


@pytest.mark.slow
def test_limits_are_those_of_the_robot(vsacli: Any) -> None:
    files = [REPOSITORY / folder / "scara_4.yaml" for folder in ("robots", "trajectories")]
    assert vsacli("invdyn", *files, "-o", "r.h5").code == 0
    limits = page_of(vsacli, "r.h5").chart("q", "(prismatic joints)")["limits"]
    slide = load_robot(files[0]).joints[2].limits.position
    assert limits == [{"joint": 2, "value": value} for value in slide]


@pytest.mark.slow
def test_stretches_are_those_where_steps_fail(vsacli: Any, infeasible_result: Path) -> None:
    page = page_of(vsacli, infeasible_result)
    [file] = page.data["files"]
    with h5py.File(infeasible_result) as stored:
        time, flags = stored["time"][...], stored["flags"][...]
    for kind, bits in (("infeasible", 1), ("near-singular", 4)):
        for joint, spans in enumerate(file["troubles"].get(kind, [[]] * 3)):
            inside = np.any([(start <= time) & (time <= end) for start, end in spans or [(1, 0)]], axis=0)
            np.testing.assert_array_equal(inside, (flags[:, joint] & bits) != 0)
    assert "infeasible" in file["troubles"]


def test_the_chain_has_the_positions_and_rows_of_the_file(page: Page, feasible_result: Path) -> None:
    [file] = page.data["files"]
    chain, robot = file["arm"], load_robot(ROBOT)
    with h5py.File(feasible_result) as stored:
        positions, time = stored["q"][...], stored["time"][...]
    q = page.array(chain["motion"]["q"]).reshape(401, 3)
    np.testing.assert_allclose(q, positions, rtol=SINGLE)
    np.testing.assert_allclose(page.array(chain["motion"]["time"]), time, rtol=SINGLE)
    assert [joint["dh"] for joint in chain["joints"]] == [asdict(joint.dh) for joint in robot.joints]
    assert chain["down"] == [0, 0, -1]


def test_differences_have_the_rms_over_all_common_times(
    vsacli: Any, tmp_path: Path, feasible_result: Path
) -> None:
    """The other result has other steps, and ends with another stiffness."""
    other = edited(
        rest_to_rest(tmp_path / "other.yaml", 1200), tmp_path / "half.yaml", ("rate: 100 ", "rate: 50 ")
    )
    assert vsacli("invdyn", ROBOT, other, "-o", "half.h5", "-q").code == 0
    page = page_of(vsacli, feasible_result, "half.h5")
    with h5py.File(feasible_result) as one, h5py.File("half.h5") as two:
        apart = two["tau_motor"][:, 1, 0] - one["tau_motor"][::2, 1, 0]
    difference = page.chart("tau_motor", "difference: motor torque, joint side of the gear, motor 1")
    [shoulder] = [each for each in difference["series"] if each["joint"] == 1]
    assert shoulder["rms"] == pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-9)
    np.testing.assert_allclose(page.array(shoulder["values"]), apart, rtol=SINGLE)


def test_a_peak_of_one_sample_survives(vsacli: Any, tmp_path: Path) -> None:
    motion = edited(rest_to_rest(tmp_path / "m.yaml"), tmp_path / "long.yaml", ("rate: 100 ", "rate: 2000 "))
    assert vsacli("invdyn", ROBOT, motion, "-o", "long.h5", "-q", "--variables", "q,tau_e,flags").code == 0
    with h5py.File("long.h5", "r+") as file:
        file["tau_e"][4321, 0] = 777.0
    whole = _base_torque(page_of(vsacli, "long.h5"))
    assert whole.max() == 777.0
    assert whole.size < 8001
    part = page_of(vsacli, "long.h5", "--from", 2, "--to", 3)
    assert part.data["span"] == [0, 1]
    assert (_base_torque(part).max(), _base_torque(part).size) == (777.0, 2001)


def _base_torque(page: Page) -> np.ndarray:
    [values] = [page.array(each["values"]) for each in page.chart("tau_e")["series"] if each["joint"] == 0]
    return values


def test_scripts_are_those_that_the_policy_names_and_nothing_leads_outside(page: Page) -> None:
    [policy] = [
        str(attributes["content"])
        for tag, attributes in page.tags
        if tag == "meta" and attributes.get("http-equiv") == "Content-Security-Policy"
    ]
    hashes = re.findall(r"'sha256-([^']+)'", policy)
    assert hashes == [
        base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in page.scripts
    ]
    assert "default-src 'none'" in policy
    assert "unsafe-eval" not in policy
    leading_or_acting = re.compile(r"src|href|on\w+")
    assert not [tag for tag, attributes in page.tags if any(map(leading_or_acting.fullmatch, attributes))]


@pytest.mark.cases(7)
@pytest.mark.parametrize("kind", slow_but(("markdown", "markup", "unprintable bidirectional"), TEXTS))
def test_no_text_of_a_file_acts(vsacli: Any, page: Page, feasible_result: Path, kind: str) -> None:
    """Of files that were made by other means, or hold such texts as paths and command lines."""
    text = TEXTS[kind].encode("utf-8", "backslashreplace").decode().replace("\0", "\\0")
    shutil.copy(feasible_result, "wicked.h5")
    with h5py.File("wicked.h5", "r+") as file:
        for attribute in ("robot_name", "trajectory_name"):
            file.attrs[attribute] = text
        file.attrs["command_line"] = f"vsacli {text}"
        file["joint"][0] = text
        file["inputs/file_1"].attrs["path"] = text
        file["inputs/file_1/text"][()] = f"# {text}</pre></script><script>alert(1)</script>"
        report = json.loads(file["report/json"][()])
        report["joints"][0]["name"] = report["robot"] = text
        report["warnings"] = [text, "<img src=x onerror=alert(1)>"]
        file["report/json"][()] = json.dumps(report)
    wicked = page_of(vsacli, "wicked.h5")
    of_warnings = [("p", {"class": "line"}), ("div", {"class": "findings"})]
    assert wicked.tags.count(of_warnings[1]) == 1
    assert [tag for tag in wicked.tags if tag not in of_warnings] == [
        tag for tag in page.tags if tag not in of_warnings
    ]
    assert wicked.scripts == page.scripts
    assert clean(wicked.text)


def test_without_the_library_a_sentence_says_what_to_install(
    vsacli: Any, tmp_path: Path, feasible_result: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> None:
        raise PackageNotFoundError(name)

    monkeypatch.setattr("vsacli.results.pages.document.distribution", missing)
    done = vsacli("plot", feasible_result, "--format", "html", "-o", str(tmp_path / "pages"))
    assert done.code == 2
    assert done.err == ("pages need the package bokeh, which is not installed; pip install bokeh gets it\n")
    assert not (tmp_path / "pages").exists()


def test_a_page_of_variables_that_have_no_plot_is_refused(vsacli: Any, motion: Path) -> None:
    assert vsacli("invdyn", ROBOT, motion, "-o", "r.h5", "--variables", "flags").code == 0
    done = vsacli("plot", "r.h5", "--format", "html")
    assert (done.code, done.err) == (
        2,
        "r.h5: nothing can be plotted: holds no variable that has a plot\n",
    )


def test_a_result_reads_its_geometry(feasible_result: Path) -> None:
    robot = load_robot(ROBOT)
    with StoredResult.open(feasible_result) as result:
        geometry = result.geometry()
    assert [row.dh for row in geometry.joints] == [joint.dh for joint in robot.joints]
    assert (geometry.base, geometry.end_effectors) == (robot.base, (robot.tool,))
    assert (geometry.parents, geometry.tool_joints) == (robot.parents, robot.tool_joints)


@pytest.mark.slow
def test_a_recorded_motion_has_bands_and_unreliable_ends(vsacli: Any, feasible_result: Path) -> None:
    assert vsacli("export", feasible_result, "--variables", "q,stiffness", "-o", "measured.csv").code == 0
    vsacli("invdyn", ROBOT, "measured.csv", "-o", "again.h5", "-q")
    page = page_of(vsacli, "again.h5")
    with h5py.File("again.h5") as stored:
        report = json.loads(stored["report/json"][()])
        q, deviation = stored["q"][:, 0], stored["q_std"][:, 0]
    columns = [column for fit in report["fits"] for column in fit["columns"]]
    start, end = (max(column["unreliable"][side] for column in columns) for side in ("start", "end"))
    assert page.data["files"][0]["unreliable"] == [[0, pytest.approx(start)], [pytest.approx(4 - end), 4]]
    [base] = [each for each in page.chart("q")["series"] if each["joint"] == 0]
    np.testing.assert_allclose(
        page.array(base["band"][1]), q + 2 * deviation, atol=2 * SINGLE * np.abs(q).max()
    )
    assert page.chart("q")["band"] == "two standard deviations"
    inside = page_of(vsacli, "again.h5", "--from", 1, "--to", 3)
    assert inside.data["files"][0]["unreliable"] == []


WRONG = [{"fits": 3}, {"fits": [3]}, {"fits": [{"columns": [{"unreliable": {"start": "long", "end": 0}}]}]}]


@pytest.mark.parametrize("wrong", WRONG)
def test_a_report_of_another_form_is_refused_with_a_sentence(
    vsacli: Any, feasible_result: Path, wrong: dict[str, Any]
) -> None:
    shutil.copy(feasible_result, "odd.h5")
    with h5py.File("odd.h5", "r+") as file:
        file["report/json"][()] = json.dumps({**json.loads(file["report/json"][()]), **wrong})
    done = vsacli("plot", "odd.h5", "--format", "html")
    assert done.code == 2
    sentence = r"odd\.h5: variable report is damaged or truncated; compute it again\n"
    assert re.fullmatch(sentence, done.err)
    assert not Path("odd.html").exists()


@pytest.mark.slow
def test_infinities_of_a_run_that_diverged_are_gaps(vsacli: Any, feasible_result: Path) -> None:
    """Without a warning, which is an error in tests."""
    shutil.copy(feasible_result, "far.h5")
    with h5py.File("far.h5", "r+") as file:
        file["q"][200:] = np.inf
        file["tau_motor"][200:] = 1e300
    page = page_of(vsacli, "far.h5")
    values = page.array(page.chart("tau_motor", "motor 1")["series"][0]["values"])
    assert np.isfinite(values[:200]).all()
    assert np.isnan(values[200:]).all()
    both = page_of(vsacli, feasible_result, "far.h5")
    apart = [each["rms"] for chart in both.charts for each in chart["series"] if each["rms"] is not None]
    assert 0.0 in apart
