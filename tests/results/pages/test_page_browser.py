"""Pages in a browser: drawn without complaint, linked, led by mouse and keys, in the dark and on paper."""

from __future__ import annotations

import base64
import contextlib
import io
import re
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from samples.browser import Browser, browsing
from samples.command_line import REPOSITORY, REST_TO_REST, ROBOT, edited, rest_to_rest
from samples.marks import needs
from samples.measured_pages import wicked_page
from samples.studies import study
from samples.torso import torso_result

from vsacli.cli.main import run

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
    drawn = browser.run(
        """const { arm } = vsacli.data.files[0], { array } = vsacli;
        return [arm.tools, arm.tool_carriers, array(arm.origins).length, array(arm.seats).length]"""
    )
    assert drawn == [["left_hand", "right_hand", "lamp"], [4, 7, 8], 41 * (9 + 3) * 3, 41 * 8 * 3]
    picture = "return document.getElementById('arm').toDataURL()"
    still = browser.settled(picture)
    browser.find("#play").click()
    browser.run("return new Promise(done => setTimeout(done, 400))")
    browser.find("#play").click()
    assert browser.settled(picture) != still
    assert not browser.complaints()


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
        """const { data, array, robot: { down } } = vsacli, points = array(data.files[0].arm.origins);
        return Array.from({ length: points.length / 3 }, (_, at) =>
          -down.reduce((sum, part, axis) => sum + part * points[3 * at + axis], 0));"""
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


@pytest.mark.cases(3)  # with tables of failures, of several results, and of runs
@pytest.mark.parametrize("name", ["failing", "compared", "result", "studied", "simulated"])
def test_no_page_is_wider_than_a_phone(browser: Browser, pages: Pages, name: str) -> None:
    size = {"width": 420, "height": 900, "deviceScaleFactor": 1, "mobile": True}
    browser.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        browser.open(pages[name])
        assert browser.run("return document.documentElement.scrollWidth") == 420
        narrowest = "return Math.min(...[...document.querySelectorAll('th')].map(cell => cell.offsetWidth))"
        assert browser.run(narrowest) > 30  # no name has one letter per line
    finally:
        browser.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


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
