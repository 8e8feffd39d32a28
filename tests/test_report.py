"""`tiefmu report`: what the page says, and that a browser shows it without a network."""

import base64
import io
import json
import re
import shutil
import subprocess
import time
from html import escape, unescape
from pathlib import Path

import numpy as np
import pytest
import tiefmu
from PIL import Image
from tiefmu.cli import main
from tiefmu.view import page
from tiefmu.view.geometry import Geometry


def without_scripts(text: str) -> str:
    return re.sub(r"<script.*?</script>", "", text, flags=re.S)


def cells(text: str, caption: str) -> list[list[str]]:
    """Rows of the table whose caption starts so."""
    table = next(t for t in re.findall(r"<table>.*?</table>", text, re.S) if f"<caption>{caption}" in t)
    rows = re.findall(r"<tr>(.*?)</tr>", table.split("</thead>")[1], re.S)
    return [[unescape(cell) for cell in re.findall(r"<td>(.*?)</td>", row, re.S)] for row in rows]


@pytest.fixture
def poor(weld, scene_file):
    """A scene with a warning, a clamped slave and a dropped one."""
    weld["title"] = '<b>Weld</b> & "co"'
    weld["mesh"]["nodes"] += [[102, 0.11, 0.05, 0.01], [103, 9, 9, 9]]
    weld["tie"][0] |= {"slaves": [101, 102, 103], "unresolved": "drop"}
    return scene_file(weld)


@pytest.mark.parametrize("kind", ["scene", "fmu"])
def test_what_the_page_says(poor, kind, capsys):
    model = poor
    if kind == "fmu":
        assert main(["build", poor]) == 0
        model = "weld.fmu"
    assert main(["report", model, "-o", "weld.html"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("weld.html: 1 tie, 2 slaves, 4 masters")
    text = without_scripts(Path("weld.html").read_text())
    found = tiefmu.report(tiefmu.load(poor))
    assert f"<h1>{escape(found['title'])}</h1>" in text
    headings = re.findall(r"<h2>(.*?)</h2>", text)
    assert headings[:3] == ["Warnings", "Dropped slaves", "What is tied to what"]
    assert all(escape(line) in text for line in found["warnings"])
    assert cells(text, "Slaves that found no segment")[0][:2] == ["103", "weld"]
    far = cells(text, "The 10 slaves farthest")
    assert [row[0] for row in far] == ["101", "102"]
    assert [float(row[3]) for row in far] == pytest.approx(
        sorted((r["distance"] for r in found["slaves"]), reverse=True)
    )
    assert [row[0] for row in cells(text, "Slaves outside their segment")] == ["102"]
    heavy = cells(text, "The 10 masters with the largest")
    ratios = sorted((row["added_mass"] / row["mass"] for row in found["masters"]), reverse=True)
    assert [float(row[4]) for row in heavy] == pytest.approx(ratios, rel=1e-4)
    assert cells(text, "Limits of the time step")[0][:2] == ["stable", "no limit"]


def test_value_references_are_those_of_the_description(poor):
    import fmpy

    fmu = tiefmu.build(tiefmu.load(poor), "weld.fmu")
    assert main(["report", str(fmu)]) == 0
    assert Path("weld.html").exists()
    found = {}
    for name, references, causality, unit, _ in cells(without_scripts(Path("weld.html").read_text()), "Variables of"):
        first, _, last = references.partition(" to ")
        for reference in range(int(first), int(last or first) + 1):
            assert reference not in found
            found[reference] = (re.sub(r"\[\w+\]", "", name), causality, unit)
    expected = {
        v.valueReference: (re.sub(r"\[\w+\]", "", v.name), v.causality, v.unit)
        for v in fmpy.read_model_description(fmu).modelVariables
    }
    assert found == expected


def test_a_missing_package_is_named_with_its_extra(poor, capsys, monkeypatch):
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert main(["report", poor, "-o", "weld.html"]) == 2
    assert capsys.readouterr().err == "error: tiefmu report: needs the package plotly: pip install 'tiefmu[report]'\n"


def test_the_page_in_the_fmu_has_the_same_tables(poor):
    import zipfile

    with zipfile.ZipFile(tiefmu.build(tiefmu.load(poor), "weld.fmu")) as archive:
        inside = archive.read("documentation/index.html").decode()
    assert main(["report", "weld.fmu", "-o", "weld.html"]) == 0
    outside = without_scripts(Path("weld.html").read_text())
    for caption in re.findall(r"<caption>(.{20})", outside):
        assert cells(inside, caption) == cells(outside, caption)
    assert inside.index("<h2>Warnings") < inside.index("<h2>Dropped") < inside.index("<h2>Ties")


def drawn(found: dict, monkeypatch):
    """The figure of the page."""
    import plotly.graph_objects as go

    figures = []
    monkeypatch.setattr(go.Figure, "to_html", lambda figure, **_: figures.append(figure) or "")
    page.viewer(Geometry(found), found)
    return figures[0]


@pytest.mark.parametrize("far, titles", [(0.0, ["x [m]", "y [m]"]), (2e4, ["x -20000 [m]", "y +10000 [m]"])])
def test_a_scene_far_from_the_origin_is_drawn_near_it(weld, monkeypatch, far, titles):
    """Browsers draw in single precision: the picture's own numbers must keep a millimetre."""
    shift = np.array([far, -far / 2, 0])
    weld["mesh"]["nodes"] = [[row[0], *(np.array(row[1:]) + shift)] for row in weld["mesh"]["nodes"]]
    figure = drawn(tiefmu.report(tiefmu.load(weld)), monkeypatch)
    axes = figure.layout.scene
    assert [axes.xaxis.title.text, axes.yaxis.title.text, axes.zaxis.title.text] == [*titles, "z [m]"]
    slave = next(trace for trace in figure.data if trace.name == "slaves")
    [place] = np.float32(np.column_stack([slave.x, slave.y, slave.z])).astype(float)
    said = np.array([float(title.split()[1]) if " [" in title[1:] and title[2] != "[" else 0.0 for title in titles])
    np.testing.assert_allclose(place[:2] - said, np.array([0.03, 0.06]) + shift[:2], rtol=0, atol=1e-5)
    assert (slave.marker.cmin, slave.marker.cmax) == (0.0, pytest.approx(0.04))


# -------------------------------------------------------------------------------------------------------------- browser


class Browser:
    """Headless Chromium by its DevTools protocol."""

    def __init__(self, program: str, folder: Path):
        import websocket

        self.process = subprocess.Popen(
            [
                program,
                "--headless=new",
                "--no-sandbox",
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
                "--remote-debugging-port=0",
                "--remote-allow-origins=*",
                "--window-size=1200,900",
                f"--user-data-dir={folder}",
                "about:blank",
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        address = next(m[1] for m in (re.search(r"listening on (ws://\S+)", line) for line in self.process.stderr) if m)
        self.socket = websocket.create_connection(address, timeout=120)
        self.count, self.events, self.session = 0, [], None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Network", "Page"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters) -> dict:
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        self.socket.send(json.dumps(message | ({"sessionId": self.session} if self.session else {})))
        while True:
            answer = json.loads(self.socket.recv())
            if answer.get("id") == self.count:
                assert "error" not in answer, answer
                return answer["result"]
            self.events.append(answer)

    def evaluate(self, script: str):
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait_for(self, script: str) -> None:
        end = time.monotonic() + 120
        while not self.evaluate(script):
            assert time.monotonic() < end, script
            time.sleep(0.2)

    def picture(self, x, y, width, height) -> np.ndarray:
        clip = {"x": x, "y": y, "width": width, "height": height, "scale": 1}
        data = self.call("Page.captureScreenshot", clip=clip)["data"]
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"))

    def close(self) -> None:
        self.socket.close()
        self.process.terminate()
        self.process.wait()


# Where a point of the scene is on the page, in pixels.
WHERE = """
(() => {
  const picture = document.getElementById('picture'), scene = picture._fullLayout.scene._scene;
  const camera = scene.glplot.cameraParams, box = picture.querySelector('.gl-container canvas, canvas')
    .getBoundingClientRect();
  let p = [%s].map((x, i) => x * scene.dataScale[i]).concat([1]);
  for (const m of [camera.model, camera.view, camera.projection])
    p = [0, 1, 2, 3].map(r => m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r] * p[3]);
  return [box.left + box.width * (1 + p[0] / p[3]) / 2, box.top + box.height * (1 - p[1] / p[3]) / 2];
})()
"""


@pytest.fixture
def browser(tmp_path):
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    assert program, "no Chromium here: make browser installs it"
    found = Browser(program, tmp_path / "profile")
    yield found
    found.close()


@pytest.mark.browser
def test_a_browser_shows_it(weld, scene_file, browser, tmp_path):
    name = scene_file(weld)
    assert main(["report", name, "-o", "weld.html"]) == 0
    browser.call("Page.navigate", url=(tmp_path / "weld.html").as_uri())
    browser.wait_for("!!(document.getElementById('picture') || {})._fullLayout")
    browser.wait_for("!!document.getElementById('picture')._fullLayout.scene._scene.glplot.cameraParams")
    browser.evaluate("document.getElementById('picture').scrollIntoView(); 0")
    time.sleep(1)
    x, y = browser.evaluate(WHERE % "0.03, 0.06, 0.04")
    scroll = browser.evaluate("[window.scrollX, window.scrollY]")

    near = browser.picture(x + scroll[0] - 150, y + scroll[1] - 100, 300, 200)
    colours = np.unique(near.reshape(-1, 3), axis=0)
    assert len(colours) > 20
    assert (near != near[0, 0]).any(axis=2).mean() > 0.02

    browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=x - 40, y=y - 40)
    browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    shown = "[...document.querySelectorAll('.hoverlayer, .hovertext')].map(e => e.textContent).join()"
    browser.wait_for(f"{shown}.includes('slave 101')")

    requests = [e["params"]["request"]["url"] for e in browser.events if e.get("method") == "Network.requestWillBeSent"]
    assert requests and all(url.startswith(("file:", "data:", "blob:")) for url in requests)
    loud = [
        event
        for event in browser.events
        if event.get("method") == "Runtime.exceptionThrown"
        or (event.get("method") == "Runtime.consoleAPICalled" and event["params"]["type"] == "error")
        or (event.get("method") == "Log.entryAdded" and event["params"]["entry"]["level"] == "error")
    ]
    assert not loud
