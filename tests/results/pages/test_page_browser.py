"""Pages in a browser: drawn without complaint, linked, led by mouse and keys, in the dark and on paper."""

from __future__ import annotations

import base64
import contextlib
import io
import re
from collections.abc import Iterator
from pathlib import Path

import h5py
import matplotlib.image
import numpy as np
import pytest
from samples.browser import Browser, browsing
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT, edited, rest_to_rest
from samples.marks import needs
from samples.measured_pages import wicked_page
from samples.studies import study
from samples.torso import torso_result

from vsacli import Robot, forward_kinematics, load_robot
from vsacli.cli.main import run
from vsacli.results.charts.arm_chart import ArmPoints

pytestmark = [pytest.mark.slow, needs("chromium", "chromium"), needs("chromedriver", "chromium-driver")]

WINDOWS = """return vsacli.charts.cards.filter(c => c.figure && c.visible)
.map(({ figure }) => [figure.x_range.start, figure.x_range.end])"""
"""What of time the plots in sight show."""

SIX_DIGITS = 1e-5
"""What a legend shows is rounded to six digits, half a unit of the last one."""


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browsing(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


class Pages:
    """Pages by name, each made when it is first asked for; `folder` has the files."""

    def __init__(self, folder: Path, feasible: Path, infeasible: Path) -> None:
        self.folder, self._feasible, self._infeasible = folder, feasible, infeasible
        self._made: dict[str, Path] = {}

    def __getitem__(self, name: str) -> Path:
        if name not in self._made:
            self._made[name] = self._page(*getattr(self, f"_{name}")())
        return self._made[name]

    def _page(self, *files: Path) -> Path:
        self._run("plot", *files, "--format", "html", "-o", self.folder)
        return self.folder / f"{'-'.join(file.stem for file in files)}.html"

    def _run(self, *arguments: object) -> None:
        with contextlib.redirect_stdout(io.StringIO()):
            assert run([*map(str, arguments), "-q"]) in (0, 3)

    def _result(self) -> list[Path]:
        return [self._feasible]

    def _failing(self) -> list[Path]:
        return [self._infeasible.rename(self.folder / "failing.h5")]

    def _compared(self) -> list[Path]:
        motion = rest_to_rest(self.folder / "other.yaml", 1200)
        self._run("invdyn", ROBOT, motion, "-o", self.folder / "other.h5")
        return [self._feasible, self.folder / "other.h5"]

    def _sliding(self) -> list[Path]:
        files = [REPOSITORY / folder / "scara_4.yaml" for folder in ("robots", "trajectories")]
        self._run("invdyn", *files, "-o", self.folder / "scara.h5")
        return [self.folder / "scara.h5"]

    def planar(self, gravity: list[float]) -> Path:
        """A planar arm under this gravity; its own is along -y, in the plane of the arm."""
        files = [REPOSITORY / folder / "planar_2r.yaml" for folder in ("robots", "trajectories")]
        target = self.folder / f"planar{'_'.join(map(str, gravity))}.h5"
        self._run("invdyn", *files, "--set", f"gravity={gravity}", "--set", "rate=20", "-o", target)
        return self._page(target)

    def _simulated(self) -> list[Path]:
        motion = edited(REST_TO_REST, self.folder / "short.yaml", ("rate: 1000 ", "rate: 50 "))
        self._run("simulate", ROBOT, motion, "-o", self.folder / "simulated.h5")
        return [self.folder / "simulated.h5"]

    def _posed(self, name: str = "scara_4") -> list[Path]:
        return [REPOSITORY / "robots" / f"{name}.yaml"]

    def of_robot(self, name: str) -> Path:
        """A bundled robot without a motion."""
        folder = self.folder / name
        self._run("plot", *self._posed(name), "--format", "html", "-o", folder)
        return folder / f"{name}.html"

    def _studied(self) -> list[Path]:
        self._run("study", study(self.folder), "-o", self.folder / "studied.h5")
        return [self.folder / "studied.h5"]


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory, feasible_result: Path, infeasible_result: Path) -> Pages:
    folder = tmp_path_factory.mktemp("pages")
    failing = folder / "infeasible.h5"
    failing.write_bytes(infeasible_result.read_bytes())
    return Pages(folder, feasible_result, failing)


LOOKS = [
    *((name, "light") for name in ("result", "failing", "compared", "sliding", "simulated", "studied")),
    *((name, "dark") for name in ("failing", "studied")),
]


@pytest.mark.cases(4)
@pytest.mark.parametrize(("name", "scheme"), LOOKS)
def test_plots_are_drawn_without_complaint(browser: Browser, pages: Pages, name: str, scheme: str) -> None:
    browser.media(prefers_color_scheme=scheme)
    browser.open(pages[name])
    if name == "result":
        browser.run("document.querySelectorAll('details.section').forEach(d => { d.open = true; })")
        browser.run("return vsacli.charts.buildRest()")
    seen = "[...document.querySelectorAll('.plot')].filter(p => !p.closest('details:not([open])'))"
    plots = browser.run(f"return {seen}.map(p => p.childElementCount)")
    assert len(plots) > 2
    assert all(plots)
    assert browser.complaints() == []
    assert browser.run("return performance.getEntriesByType('resource').length") == 0
    dark = browser.run("return getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
    assert dark == (scheme == "dark")


@pytest.fixture
def page(browser: Browser, pages: Pages) -> Browser:
    """The page of a result, in the light, as far as it is in sight."""
    browser.media(prefers_color_scheme="light")
    return browser.open(pages["result"], whole=False)


def test_legends_name_the_joints_and_say_their_values_at_the_cursor(
    page: Browser, feasible_result: Path
) -> None:
    page.run("vsacli.setCursor(arguments[0])", 1.234)
    said = page.settled("return document.querySelector('.chart .legend').innerText")
    with h5py.File(feasible_result) as file:
        wanted = [np.interp(1.234, file["time"], column) for column in file["q"][...].T]
    found = re.findall(r"(\w+)\s+(-?[\d.]+)", said)
    assert [name for name, _ in found] == ["base", "shoulder", "elbow"]
    np.testing.assert_allclose([float(value) for _, value in found], wanted, rtol=SIX_DIGITS)


def test_the_mouse_over_a_plot_moves_the_cursor(page: Browser) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    before = page.find("#time").text
    ActionChains(page.driver).move_to_element(page.find(".plot")).perform()
    assert page.settled("return document.getElementById('time').textContent") != before
    assert page.run("return vsacli.state.cursor") == pytest.approx(2, abs=0.5)  # axes take some of the width


def test_dragging_over_a_plot_zooms_all_of_them(page: Browser) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    plot = page.find(".plot")
    ActionChains(page.driver).move_to_element(plot).click_and_hold().move_by_offset(
        100, 0
    ).release().perform()
    zoomed = page.settled(WINDOWS)
    assert len(zoomed) > 1
    assert zoomed == [zoomed[0]] * len(zoomed)
    start, end = zoomed[0]
    assert 1.5 < start < end < 4
    assert page.run("return vsacli.charts.cards.some(c => c.figure && !c.visible)")
    page.run("scrollTo(0, document.body.scrollHeight / 2)")
    later = page.settled(WINDOWS)
    assert later == [zoomed[0]] * len(later)


def test_keys_zoom_move_and_show_all(page: Browser) -> None:
    page.run("vsacli.setCursor(2)")
    page.press("+")
    assert page.settled(WINDOWS)[0] == pytest.approx([1, 3])
    page.press("++")
    assert page.settled(WINDOWS)[0] == pytest.approx([1.75, 2.25])
    page.press("-")
    assert page.settled(WINDOWS)[0] == pytest.approx([1.5, 2.5])
    page.press("\ue014")  # arrow to the right
    assert page.run("return vsacli.state.cursor") == pytest.approx(2 + 1 / 200)
    page.press("0")
    assert page.settled(WINDOWS)[0] == pytest.approx([0, 4])


def test_controls_are_reached_by_tab(page: Browser) -> None:
    reached = set()
    for _ in range(20):
        page.press("\ue004")
        reached.add(page.run("return document.activeElement.id || document.activeElement.className"))
    assert {"play", "cursor", "zoom-in", "zoom-out", "zoom-all", "chip", "arm"} <= reached


def test_time_runs_and_the_robot_moves(page: Browser) -> None:
    picture = "return document.getElementById('arm').toDataURL()"
    still = page.run(picture)
    page.find("#play").click()
    moved = page.run("return new Promise(done => setTimeout(() => done(vsacli.state.cursor), 700))")
    page.find("#play").click()
    assert moved > 0.1
    assert page.settled(picture) != still


def test_a_tree_moves_with_its_tools(browser: Browser, tmp_path: Path) -> None:
    torso_result(tmp_path).save(tmp_path / "torso.h5")
    assert run(["plot", str(tmp_path / "torso.h5"), "--format", "html", "-o", str(tmp_path), "-q"]) == 0
    browser.open(tmp_path / "torso.html", whole=False)
    tools = browser.run("return vsacli.robot.arms[0].tools.map(({ name, carrier }) => [name, carrier])")
    assert tools == [["left_hand", 4], ["right_hand", 7], ["lamp", 8]]
    assert_points(browser, load_robot(tmp_path / "tree.yaml"), stored_positions(tmp_path / "torso.h5"))
    picture = "return document.getElementById('arm').toDataURL()"
    still = browser.settled(picture)
    browser.find("#play").click()
    browser.run("return new Promise(done => setTimeout(done, 400))")
    browser.find("#play").click()
    assert browser.settled(picture) != still
    assert not browser.complaints()


def stored_positions(path: Path) -> np.ndarray:
    with h5py.File(path) as file:
        return np.asarray(file["q"][...])


SINGLE = 4e-7
"""Error of a point of an arm of about 1 m, m, with positions of up to 3 rad in single precision."""


def assert_points(browser: Browser, robot: Robot, q: np.ndarray) -> None:
    """Compare the points at the instants of a motion with those of the package, all in the base frame."""
    points = ArmPoints.of(robot, q)
    passed = browser.run("return vsacli.robot.arms[0].passed")
    np.testing.assert_allclose(passed, np.concatenate((points.origins, points.tools), axis=1), atol=SINGLE)
    np.testing.assert_allclose(np.array(passed)[:, 1:], forward_kinematics(robot, q)[..., :3, 3], atol=SINGLE)


def test_the_chain_moves_as_forward_kinematics_says(page: Browser, feasible_result: Path) -> None:
    assert_points(page, load_robot(ROBOT), stored_positions(feasible_result))


FALL = """const { flat } = vsacli.robot.eye(), [from, to] = [flat([0, 0, 0]), flat(arguments[0])];
return [to[0] - from[0], to[1] - from[1]]"""
"""The way of a point that moves along a vector, to the right and down in the picture, pixels."""

DARKEST = """const arm = document.getElementById('arm');
const { data } = arm.getContext('2d').getImageData(0, 0, 0.12 * arm.width, 0.25 * arm.height);
let darkest = 255;
for (let at = 0; at < data.length; at += 4) if (data[at + 3] > 250) darkest = Math.min(darkest, data[at]);
return darkest"""
"""Smallest red component of an opaque pixel in the corner of the arrow; the ground's lines are light."""

GRAVITIES = [[9.81, 0, 0], [0, -9.81, 0], [3, -8, 2], [0, 0, 9.81]]


@pytest.mark.cases(2)  # one along an axis in the plane of the arm, one along none
@pytest.mark.parametrize("gravity", GRAVITIES)
def test_up_is_against_gravity_with_its_arrow(browser: Browser, pages: Pages, gravity: list[float]) -> None:
    browser.media(prefers_color_scheme="light")
    browser.open(pages.planar(gravity), whole=False)
    for turned in ("", "vsacli.robot.view.turn += 1;", "vsacli.robot.view.tilt = -0.3;"):
        aside, down = browser.run(turned + FALL, gravity)
        assert down > 10 * abs(gravity[1])
        assert abs(aside) < 1e-9 * down
    heights = browser.run(
        """const { arms, down } = vsacli.robot;
        const height = (point) => -down.reduce((sum, part, axis) => sum + part * point[axis], 0);
        return arms[0].passed.flat().map(height);"""
    )
    assert min(heights) > browser.run("return vsacli.robot.ground()")  # nothing is below the ground
    assert browser.settled(DARKEST) < 80


def test_the_z_axis_is_up_without_gravity_and_there_is_no_arrow(browser: Browser, pages: Pages) -> None:
    browser.media(prefers_color_scheme="light")
    browser.open(pages.planar([0, 0, 0]), whole=False)
    aside, down = browser.run(FALL, [0, 0, -1])
    assert (aside, down > 10) == (pytest.approx(0, abs=1e-9), True)
    assert browser.settled(DARKEST) > 200


def test_a_filter_hides_a_joint_everywhere_and_axes_follow(page: Browser) -> None:
    axis = "const y = vsacli.charts.cards[0].figure.y_range; return [y.start, y.end]"
    whole = page.run(axis)
    page.find(".chip").click()
    assert "base" not in page.settled("return document.querySelector('.chart .legend').innerText")
    low, high = page.run(axis)
    assert whole[0] <= low < high < whole[1]  # the base has the largest positions
    assert not page.run("return vsacli.charts.cards[0].curves[0].drawn[0].visible")


AREAS = """const { figure } = vsacli.charts.cards[0], { start, end } = figure.y_range;
const [{ data_source: { data } }] = figure.renderers.filter(each => each.glyph.type === 'Quad');
const share = (value) => (value - start) / (end - start);
return data.paint.map((paint, at) => ({ paint, top: share(data.top[at]), bottom: share(data.bottom[at]) }))"""
"""Marks of failures in the first plot, as shares of its height, with their colors."""


def test_failures_are_marked_and_the_robot_says_what_is_wrong(browser: Browser, pages: Pages) -> None:
    """In strips of the joints' colors below the curves of several joints, behind the curve of one."""
    browser.media(prefers_color_scheme="light")
    browser.open(pages["failing"])
    failing = browser.texts(".trouble span")
    assert failing
    browser.run("vsacli.setCursor(4)")
    assert "infeasible" in browser.settled("return document.getElementById('arm-note').textContent")
    names = browser.run("return vsacli.data.joints.map(joint => joint.name)")
    paints = browser.run("return vsacli.data.joints.map((_, joint) => vsacli.curveColor(joint))")
    areas = browser.run(AREAS)
    assert {area["paint"] for area in areas} == {paints[names.index(name)] for name in failing}
    assert all(area["top"] < 0.03 * len(failing) for area in areas)
    lowest = browser.run(
        """const card = vsacli.charts.cards[0], { start, end } = card.figure.y_range;
        return (card.curveExtent().start - start) / (end - start)"""
    )
    assert lowest > max(area["top"] for area in areas)  # no curve passes through a strip
    assert "infeasible, by color of joint" in browser.texts(".chart .legend")[0]
    for name in names:
        browser.run("vsacli.state.joints = new Set([arguments[0]]); vsacli.tell('shown')", names.index(name))
        alone = browser.run(AREAS)
        assert [(area["bottom"], area["top"]) for area in alone] == [pytest.approx((0, 1))] * len(alone)
        assert bool(alone) == (name in failing)
    assert "by color of joint" not in browser.texts(".chart .legend")[0]


def test_a_run_of_a_study_is_found_in_all_plots(browser: Browser, pages: Pages) -> None:
    browser.open(pages["studied"])
    browser.find("table.runs tbody tr").click()
    assert browser.run("return document.querySelectorAll('tr[aria-selected=true]').length") == 1
    assert browser.complaints() == []


def test_a_page_can_be_printed(page: Browser) -> None:
    printed = page.driver.execute_cdp_cmd("Page.printToPDF", {"printBackground": False})
    content = base64.b64decode(printed["data"])
    assert content.startswith(b"%PDF")
    assert content.count(b"/Subtype /Image") == 0  # plots and robot are lines


INKS = """const inks = new Set();
for (const each of document.querySelectorAll('.copy *')) {
  inks.add(each.getAttribute('fill')); inks.add(each.getAttribute('stroke'));
}
return [...inks]"""

BRIGHTEST = """const arm = document.getElementById('arm');
const { data } = arm.getContext('2d').getImageData(0, 0, arm.width, arm.height);
let brightest = 0;
for (let at = 0; at < data.length; at += 4) {
  if (data[at + 3] > 250) brightest = Math.max(brightest, data[at + 1]);
}
return brightest"""
"""Largest green component of an opaque pixel of the robot."""


@pytest.mark.cases(2)  # of a robot's motion, and of a table
@pytest.mark.parametrize("name", ["result", "failing", "studied", "compared", "simulated"])
def test_paper_has_the_colors_of_paper_in_the_dark(browser: Browser, pages: Pages, name: str) -> None:
    """As a browser prints: every plot of an open section is copied in the same colors as in the light."""
    inks = {}
    for scheme in ("light", "dark"):
        browser.media(prefers_color_scheme=scheme)
        browser.open(pages[name])
        browser.run("dispatchEvent(new Event('beforeprint'))")
        inks[scheme] = set(browser.run(INKS))
        uncopied = "document.querySelectorAll('details[open] > .charts .plot:not(.copied)').length"
        assert browser.run(f"return {uncopied}") == 0
        assert browser.run("return document.querySelectorAll('.copy').length") > 2
        browser.run("dispatchEvent(new Event('afterprint'))")
        assert browser.run("return document.querySelectorAll('.copy, .copied').length") == 0
        ground = browser.run("return vsacli.color('ground')")
        assert (ground == "#ffffff") == (scheme == "light")  # as before
    assert inks["dark"] == inks["light"]
    assert browser.complaints() == []


def test_the_robot_is_dark_on_paper(browser: Browser, pages: Pages) -> None:
    browser.media(prefers_color_scheme="dark")
    browser.open(pages["result"], whole=False)
    dark = browser.settled(BRIGHTEST)
    browser.run("dispatchEvent(new Event('beforeprint'))")
    paper = browser.run(BRIGHTEST)
    browser.run("dispatchEvent(new Event('afterprint'))")
    assert paper < dark


@contextlib.contextmanager
def as_phone(browser: Browser, height: int = 900) -> Iterator[None]:
    """The browser in the size of a phone."""
    size = {"width": 420, "height": height, "deviceScaleFactor": 1, "mobile": True}
    browser.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        yield
    finally:
        browser.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


@pytest.mark.cases(4)  # with tables of failures, of several results, and of runs; and a robot
@pytest.mark.parametrize("name", ["failing", "compared", "result", "studied", "simulated", "posed"])
def test_no_page_is_wider_than_a_phone(browser: Browser, pages: Pages, name: str) -> None:
    with as_phone(browser):
        browser.open(pages[name])
        assert browser.run("return document.documentElement.scrollWidth") == 420
        narrowest = "return Math.min(...[...document.querySelectorAll('th')].map(cell => cell.offsetWidth))"
        assert browser.run(narrowest) is None or browser.run(narrowest) > 30  # not one letter per line


EDGES = """const { left, right, top } = document.querySelector(arguments[0]).getBoundingClientRect();
return [left, right, top].map((place) => Math.round(place))"""
"""Where an element is in the window, pixels."""


def edge_brightness(browser: Browser, selector: str) -> tuple[float, float]:
    """Brightness of the background near the left and the right edge of an element, 0 to 1."""
    left, right, top = browser.settled(EDGES, selector)
    picture = matplotlib.image.imread(io.BytesIO(browser.driver.get_screenshot_as_png()))[..., :3]
    background = picture[top + 1 : top + 12].mean(axis=-1).max(axis=0)  # of rows with and without letters
    return background[left + 6], background[right - 7]  # beside borders and scroll bars


@pytest.mark.parametrize(("name", "selector"), [("result", ".wide"), ("posed", "pre")])
def test_a_table_that_a_phone_cuts_off_has_a_shadow_there(
    browser: Browser, pages: Pages, name: str, selector: str
) -> None:
    browser.media(prefers_color_scheme="light")
    with as_phone(browser):
        browser.open(pages[name])
        find = f"const table = document.querySelector('{selector}');"
        browser.run(f"{find} table.scrollIntoView({{ block: 'center' }});")
        assert browser.run(f"{find} return table.scrollWidth - table.clientWidth") > 30
        left, right = edge_brightness(browser, selector)
        assert left > 0.97
        assert right < 0.92
        browser.run(f"{find} table.scrollLeft = 1e4")
        assert edge_brightness(browser, selector)[1] > 0.97
        if name == "result":  # names of joints stay in sight
            assert browser.run(EDGES, "table.joints tbody th")[0] == browser.run(EDGES, selector)[0]


@pytest.fixture
def posed(browser: Browser, pages: Pages) -> Browser:
    """The page of a robot without a motion."""
    browser.media(prefers_color_scheme="light")
    return browser.open(pages["posed"])


PICTURE = "return document.getElementById('arm').toDataURL()"

MOVE = """document.querySelectorAll('#sliders input').forEach((slider, joint) => {
  slider.value = arguments[0][joint]; slider.dispatchEvent(new Event('input'));
});
const { arms, pointsNow } = vsacli.robot, points = pointsNow(arms[0]);
return [vsacli.state.positions, points.origins, points.seats, points.elbows, points.axes]"""
"""Move sliders; the positions that they have then, and the points of the robot."""

SPARE = """const { arms, pointsNow, eye } = vsacli.robot, { flat } = eye();
const { width, height } = document.getElementById('arm');
return Math.min(...pointsNow(arms[0]).origins.map(flat).flatMap(([x, y]) => [x, width - x, y, height - y]))"""
"""Distance of the robot from the edge of its picture, pixels."""


@pytest.mark.cases(2)  # a tree, and a slide with limits
@pytest.mark.parametrize("name", ["torso_2x3r", "scara_4", "hand_3x2r", "rp_2", "panda_7r"])
def test_sliders_move_a_robot_as_forward_kinematics_says(browser: Browser, pages: Pages, name: str) -> None:
    browser.open(pages.of_robot(name))
    robot = load_robot(REPOSITORY / "robots" / f"{name}.yaml")
    ranges = np.array([joint["range"] for joint in browser.run("return vsacli.data.joints")])
    for asked in np.random.default_rng(0).uniform(*ranges.T, (5, len(ranges))):
        positions, *drawn = browser.run(MOVE, asked.tolist())
        np.testing.assert_allclose(positions, asked, atol=np.ptp(ranges) / 1000)  # steps of a slider
        points = ArmPoints.of(robot, np.array([positions]))
        origins = np.concatenate((points.origins[0], points.tools[0]))
        expected = (origins, points.seats[0], points.elbows[0], points.axes[0])
        for there, wanted in zip(drawn, expected, strict=True):
            np.testing.assert_allclose(there, wanted, atol=1e-12)  # m, of arms of about 1 m; both are double
        assert browser.run(SPARE) > 0
    assert browser.complaints() == []


def test_a_robot_moves_before_there_is_a_motion(posed: Browser) -> None:
    from selenium.webdriver.common.action_chains import ActionChains

    still = posed.settled(PICTURE)
    sliders = posed.driver.find_elements("css selector", "#sliders input")
    assert [each.get_attribute("aria-label") for each in sliders] == [
        f"position of {name}" for name in ("shoulder", "elbow", "slide", "wrist")
    ]
    ActionChains(posed.driver).click_and_hold(sliders[1]).move_by_offset(60, 0).release().perform()
    moved = posed.settled(PICTURE)
    assert moved != still
    said = re.fullmatch(r"(.*) rad, (.*)°", posed.texts("#sliders output")[1])
    assert said
    assert float(said[1]) > 0.2
    assert np.degrees(float(said[1])) == pytest.approx(float(said[2]), abs=0.1)
    posed.find("#home").click()
    assert posed.settled(PICTURE) == still
    assert posed.texts("#sliders output")[2] == "0.1000 m"  # the middle of its limits
    ActionChains(posed.driver).drag_and_drop_by_offset(posed.find("#arm"), 80, 0).perform()
    assert posed.settled(PICTURE) != still
    assert posed.run("return performance.getEntriesByType('resource').length") == 0
    assert posed.complaints() == []


def test_a_moved_robot_stays_in_sight_on_a_phone(posed: Browser) -> None:
    with as_phone(posed, height=600):
        posed.run("document.querySelector('#sliders label:last-child').scrollIntoView({ block: 'end' })")
        assert posed.settled("return scrollY") > 50  # so far the picture would leave upward
        assert posed.run("return document.getElementById('arm').getBoundingClientRect().top") >= 0


def test_names_that_would_act_are_texts(browser: Browser, tmp_path: Path, feasible_result: Path) -> None:
    wicked = "<img src=x onerror=alert(1)><script>alert(2)</script>$$x$$\"'"
    file = tmp_path / "wicked.h5"
    file.write_bytes(feasible_result.read_bytes())
    with h5py.File(file, "r+") as stored:
        stored.attrs["robot_name"] = wicked
        stored["joint"][0] = wicked
    with contextlib.redirect_stdout(io.StringIO()):
        assert run(["plot", str(file), "--format", "html", "-o", str(tmp_path), "-q"]) == 0
    browser.open(tmp_path / "wicked.html")  # an alert would keep Selenium from going on
    assert browser.texts(".chip")[0] == wicked
    assert wicked in browser.find("h1").text
    assert browser.run("return document.images.length") == 0
    assert browser.complaints() == []


def test_what_comes_from_elsewhere_does_not_run(page: Browser) -> None:
    """The policy of the page, for the day on which a text is not escaped."""
    page.run("const s = document.createElement('script'); s.text = 'window.ran = 1'; document.body.append(s)")
    page.run("const i = new Image(); i.src = 'https://example.org/a.png'; document.body.append(i)")
    assert page.run("return window.ran") is None
    assert all("Content Security Policy" in complaint for complaint in page.complaints())


def test_the_page_itself_is_small(pages: Pages) -> None:
    """Without numbers: the library, style and scripts."""
    content = pages["result"].read_text(encoding="utf-8")
    packed = sum(map(len, re.findall(r'<script type="text/plain"[^>]*>([^<]*)<', content)))
    assert len(content.encode()) - packed < 2e6


def test_pages_of_what_was_measured_are_drawn_and_linked(browser: Browser, tmp_path: Path) -> None:
    browser.media(prefers_color_scheme="light")
    browser.open(wicked_page(tmp_path / "wicked.html"))  # an alert would keep Selenium from going on
    assert browser.run("return document.querySelectorAll('.plot .bk-Figure').length") == 2
    browser.run("vsacli.setCursor(1)")
    browser.press("+")
    assert browser.settled(WINDOWS) == [pytest.approx([0.5, 1.5])] * 2
    over, apart = browser.texts(".chart .legend")
    np.testing.assert_allclose(
        [float(value) for value in re.findall(r"0\.\d+", over)], [np.sin(1), np.sin(1) + 0.1], rtol=SIX_DIGITS
    )
    assert apart.endswith("rms 0.1, now\n0.1")
    assert browser.run("return document.images.length") == 0
    assert browser.complaints() == []
