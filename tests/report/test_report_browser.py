"""The report in a browser: nothing in the console, no network, the view answers, names are text, nothing sticks out."""

import shutil

import numpy as np
import pytest
from helpers.reports import HOSTILE, a_mesh, hostile_report, solid_report

webdriver = pytest.importorskip("selenium.webdriver")

BROWSER, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (BROWSER and DRIVER), reason="needs chromium and chromedriver (Debian: chromium chromium-driver)"
    ),
]

FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
# The sum of all bytes of a part of the canvas, given by shares of its width: equal pictures have equal sums.
SUM = """
const canvas = document.getElementById("canvas"), [from, to] = arguments;
const left = Math.round(from * canvas.width), right = Math.round(to * canvas.width);
const copy = Object.assign(document.createElement("canvas"), {width: right - left, height: canvas.height});
const context = copy.getContext("2d", {willReadFrequently: true});
context.drawImage(canvas, -left, 0);
const image = context.getImageData(0, 0, copy.width, copy.height).data;
let sum = 0;
for (let k = 0; k < image.length; k++) sum = (sum + image[k] * (k % 8191 + 1)) % 9007199254740881;
return sum;
"""
# Do something to the view and come back when it has been drawn again.
DO = """
const done = arguments[arguments.length - 1], canvas = document.getElementById("canvas");
const element = id => document.getElementById(id), change = (node, name) => node.dispatchEvent(new Event(name));
%s
requestAnimationFrame(() => requestAnimationFrame(() => done(Number(canvas.dataset.draws))));
"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for flag in (*FLAGS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(service=webdriver.ChromeService(DRIVER), options=options)
    driver.set_script_timeout(20)
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return hostile_report(tmp_path_factory.mktemp("report"))


@pytest.fixture
def view(browser, path):
    """The report at 1280 pixels, its view drawn."""
    opened(browser, path, 1280)
    yield browser
    assert browser.get_log("browser") == []


def opened(browser, path, width):
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    )
    browser.get(path.as_uri())
    browser.execute_async_script("""
        const done = arguments[0];
        (function wait() { document.getElementById("canvas").dataset.draws ? done() : setTimeout(wait, 20); })();
    """)


def do(browser, deed):
    return browser.execute_async_script(DO % deed)


def picture(browser, begin=0.0, end=1.0):
    return browser.execute_script(SUM, begin, end)


def test_no_errors_and_no_requests(view):
    assert view.execute_script("return performance.getEntriesByType('resource').length") == 0
    assert view.execute_script("return document.getElementById('trouble').hidden")
    assert view.get_log("browser") == []


def test_names_are_shown_as_text(view):
    assert view.title == HOSTILE
    assert view.execute_script("return document.querySelectorAll('img, script').length") == 2  # the two scripts
    options = "return [...document.getElementById('field').options].map(option => option.text)"
    assert f"x (m) {HOSTILE}" in view.execute_script(options)
    do(view, "element('field').value = 5; change(element('field'), 'change');")
    names = view.execute_script("return [...document.querySelectorAll('#scale li')].map(item => item.textContent)")
    assert sorted(names) == sorted(["left", HOSTILE])


def test_held_nodes_are_marked_and_named(view):
    plain = picture(view)
    do(view, "element('held-nodes').checked = true; change(element('held-nodes'), 'change');")
    assert picture(view) != plain
    assert view.execute_script("return document.getElementById('reasons').textContent") == f"pinned by {HOSTILE}"
    do(
        view,
        """
        const box = canvas.getBoundingClientRect(), width = box.height * 0.96, left = box.left + box.width / 2;
        canvas.dispatchEvent(new PointerEvent("pointermove", {pointerId: 1, bubbles: true,
            clientX: left - width / 2 + 1, clientY: box.top + box.height / 2 + 1}));
    """,
    )
    assert f"held node: pinned by {HOSTILE}" in view.execute_script(
        "return document.getElementById('value').textContent"
    )


@pytest.mark.parametrize("width", [1280, 400])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_nothing_sticks_out(browser, path, width, theme):
    feature = {"name": "prefers-color-scheme", "value": theme}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
    opened(browser, path, width)
    assert browser.execute_script("return innerWidth") == width
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    assert browser.execute_script("return document.getElementById('canvas').clientHeight") > 200
    ground = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert (ground == "rgb(255, 255, 255)") == (theme == "light")
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def test_the_slider_divides_before_from_after(view):
    """All to the right everything is before, all to the left everything is after, and they differ."""
    sums = {}
    for share in (0, 50, 100):
        do(view, f"element('divider').value = {share}; change(element('divider'), 'input');")
        sums[share] = picture(view, 0.3, 0.45), picture(view, 0.55, 0.7)
    assert sums[0][0] != sums[100][0] and sums[0][1] != sums[100][1]
    assert sums[50] == (sums[100][0], sums[0][1])


def test_dragging_the_line_moves_the_slider(view):
    do(
        view,
        """
        const box = canvas.getBoundingClientRect(), y = box.top + 20;
        const send = (name, share) => canvas.dispatchEvent(new PointerEvent(name,
            {pointerId: 1, clientX: box.left + share * box.width, clientY: y, bubbles: true}));
        canvas.setPointerCapture = () => {};
        send("pointerdown", 0.5); send("pointermove", 0.25); send("pointerup", 0.25);
    """,
    )
    assert float(view.execute_script("return document.getElementById('divider').value")) == pytest.approx(25, abs=0.5)


def test_every_field_looks_different(view):
    count = view.execute_script("return document.getElementById('field').options.length")
    sums = set()
    for k in range(count):
        do(view, f"element('field').value = {k}; change(element('field'), 'change');")
        sums.add(picture(view))
    assert count == 7 and len(sums) == count


def test_edges_and_contours_go_on_and_off(view):
    first = picture(view)
    for name in ("edges", "lines"):
        do(view, f"element('{name}').click();")
        assert picture(view) != first
        do(view, f"element('{name}').click();")
        assert picture(view) == first


def test_zoom_and_reset(view):
    """The wheel keeps the point under the pointer, and reset brings back what was."""
    first = picture(view)
    read = "return document.getElementById('value').textContent.replace(/^.*element/, 'element')"
    point = "{clientX: box.left + 0.6 * box.width, clientY: box.top + 0.4 * box.height, cancelable: true, %s}"
    box = "const box = canvas.getBoundingClientRect();"
    hover = f"{box} canvas.dispatchEvent(new PointerEvent('pointermove', {point}));"
    do(view, hover % "pointerId: 1")
    before = view.execute_script(read)
    wheel = f"{box} canvas.dispatchEvent(new WheelEvent('wheel', {point}));"
    do(view, wheel % "deltaY: -400")
    assert picture(view) != first
    do(view, hover % "pointerId: 1")
    after = view.execute_script(read)
    assert before.startswith("element ") and before.split(",")[0] == after.split(",")[0]
    do(view, "element('reset').click();")
    assert picture(view) == first


def test_two_fingers_zoom(view):
    """Fingers that part around the middle keep it, and make the mesh larger: its rim leaves the canvas."""
    first = picture(view, 0.0, 0.1)
    do(
        view,
        """
        const box = canvas.getBoundingClientRect(), y = box.top + 0.5 * box.height;
        const send = (name, id, share) => canvas.dispatchEvent(new PointerEvent(name,
            {pointerId: id, clientX: box.left + share * box.width, clientY: y, bubbles: true}));
        canvas.setPointerCapture = () => {};
        send("pointerdown", 1, 0.4); send("pointerdown", 2, 0.6);
        send("pointermove", 1, 0.1); send("pointermove", 2, 0.9);
        send("pointerup", 1, 0.1); send("pointerup", 2, 0.9);
    """,
    )
    assert picture(view, 0.0, 0.1) != first
    assert view.execute_script("return document.getElementById('canvas').style.touchAction") == "none"
    do(view, "element('reset').click();")
    assert picture(view, 0.0, 0.1) == first


def test_keys_move_and_zoom(view):
    first = picture(view)
    for key in ("+", "ArrowLeft", "ArrowUp"):
        do(view, f"canvas.dispatchEvent(new KeyboardEvent('keydown', {{key: '{key}', cancelable: true}}));")
        assert picture(view) != first
    do(view, "canvas.dispatchEvent(new KeyboardEvent('keydown', {key: '0', cancelable: true}));")
    assert picture(view) == first


POINT = """
const box = canvas.getBoundingClientRect();
const at = {pointerId: 1, clientX: box.left + 0.55 * box.width, clientY: box.top + 0.3 * box.height};
canvas.dispatchEvent(new PointerEvent("pointermove", at));
"""


def read_at_a_point(browser, label):
    """The name of the mesh there, the value and x."""
    do(browser, POINT)
    name, rest = browser.execute_script("return document.getElementById('value').textContent").split(f": {label}: ")
    return name, float(rest.split(";")[0]), float(rest.split("x = ")[1].split(" ")[0])


def test_values_are_those_of_the_field(view):
    """The first field is the middle of every element across; what is read lies within half an element of the point."""
    name, value, x = read_at_a_point(view, "middle (m)")
    assert name == "after"
    assert value == pytest.approx(x, abs=0.1) and 0.5 < x < 1.0


def test_a_field_that_is_linear_in_every_element_is_read_there(browser, tmp_path):
    """By its values at the corners, where it may jump: x, and one more in every second element."""
    t = a_mesh().t
    jump = np.arange(t.shape[1]) % 2
    opened(browser, hostile_report(tmp_path, cell_data={"inside (m)": lambda solution: solution[t] + jump}), 1280)
    _, value, x = read_at_a_point(browser, "inside (m)")
    assert value - x == pytest.approx(round(value - x), abs=2e-3)
    do(browser, "element('edges').click();")
    assert browser.get_log("browser") == []


def test_a_cut_through_tetrahedra_is_read_like_a_plane_mesh(browser, tmp_path):
    opened(browser, solid_report(tmp_path), 1280)
    _, value, x = read_at_a_point(browser, "middle (m)")
    assert value == pytest.approx(x, abs=0.4)
    assert "z = " in browser.execute_script("return document.getElementById('value').textContent")
    do(browser, "element('edges').click();")
    assert browser.get_log("browser") == []


def test_without_javascript_there_is_all_but_the_view(browser, path):
    browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": True})
    try:
        browser.get(path.as_uri())
        shown = browser.find_element("tag name", "body").text
        assert "needs JavaScript" in shown and "Passes" in shown and "Reproduction" in shown
        assert not browser.find_element("id", "view").is_displayed()
    finally:
        browser.execute_cdp_cmd("Emulation.setScriptExecutionDisabled", {"value": False})
