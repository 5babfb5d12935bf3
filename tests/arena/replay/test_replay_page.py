"""Replay page in a browser: loading from disk, seeking, playback, and poses of the record."""

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from arena.cli import main
from arena.replay.page import page
from arena.trial.record import read_trial
from tests.arena.browser import BROWSER, needs_browser, probed
from tests.watchdog import HANG

SAMPLE = 7
PROBE = """<pre id="result"></pre><script>
const found = {before: sample, samples: d.t.length};
scrub.value = %d; scrub.dispatchEvent(new Event("input"));
found.scrubbed = sample;
found.state = document.getElementById("state").textContent;
found.robots = d.robots.map(r => [r.x[sample], r.y[sample], r.heading[sample]]);
const pixel = (x, y) => [...g.getImageData(Math.round(x), Math.round(y), 1, 1).data];
found.pixels = d.robots.map(r => pixel(X(r.x[sample]) - 2, Y(r.y[sample])));
found.corner = pixel(3, 3);
document.getElementById("speed").value = "64";
play.click();
found.playing = play.textContent;
setTimeout(() => {
  found.after = sample; found.end = play.textContent;
  document.getElementById("result").textContent = JSON.stringify(found);
}, 2000);
</script></html>"""


@pytest.fixture
def trial(tmp_path: Path) -> Path:
    """Run eight simulated seconds of two robots."""
    arguments = ["--brain", "scripted", "--trials", "1", "--minutes", "0.1333", "--robots", "2", "--jobs", "1"]
    assert main(["run", "clustering", *arguments, "--out", str(tmp_path)]) == 0
    return tmp_path / "trial-0001.parquet"


def test_the_page_holds_the_file_and_loads_nothing_from_elsewhere(trial: Path) -> None:
    """The page has no external addresses, and its data equal those of the record."""
    assert main(["replay", str(trial)]) == 0
    text = trial.with_suffix(".html").read_text()
    assert not re.search(r"https?:|src=|href=|@import", text)
    data = json.loads(re.search(r'id="trial">(.*?)</script>', text, re.S).group(1))  # type: ignore[union-attr]
    record = read_trial(trial)
    assert data["t"] == record.times.tolist()
    assert np.array_equal(np.array(data["objects"]), record.objects)
    assert data["robots"][1]["x"] == record.columns["r1_x"].tolist()
    assert len(data["clusters"]) == len(data["t"])


def test_text_from_robots_cannot_end_the_page(trial: Path) -> None:
    """Text from firmware that contains HTML tags does not break the page."""
    record = read_trial(trial)
    record.columns["log"][0] = [{"robot": 0, "cycle": 1, "text": "</script><b>"}]
    assert page(record).count("</script>") == 2


HOSTILE = "x<!--<script>y & \u2028\u2029 </script><b>"


def test_data_of_a_page_hold_no_markup(trial: Path) -> None:
    """The page's JSON block contains no <, > or &, and its values are the record's."""
    record = read_trial(trial)
    record.columns["log"][0] = [{"robot": 0, "cycle": 1, "text": HOSTILE}]
    data = re.search(r'id="trial">(.*?)</script>', page(record), re.S).group(1)  # type: ignore[union-attr]
    assert not re.search("[<>&\u2028\u2029]", data)
    assert json.loads(data)["log"][0][0]["text"] == HOSTILE


@needs_browser
def test_a_script_comment_from_a_robot_does_not_stop_the_page(trial: Path, tmp_path: Path) -> None:
    """`<!--<script>` in a robot's text opens a state of the HTML parser in which </script> does not end a script."""
    record = read_trial(trial)
    record.columns["log"][0] = [{"robot": 0, "cycle": 1, "text": HOSTILE}]
    found = run_probe(page(record), PROBE % SAMPLE, tmp_path)
    assert found["samples"] == len(record.times)


@needs_browser
def test_the_page_loads_scrubs_and_plays_in_a_browser(trial: Path, tmp_path: Path) -> None:
    """The page loads the trial, seeks to a time and plays in a browser."""
    main(["replay", str(trial)])
    found = run_probe(trial.with_suffix(".html").read_text(), PROBE % SAMPLE, tmp_path)
    record = read_trial(trial)
    assert (found["before"], found["samples"]) == (0, len(record.times))
    assert found["scrubbed"] == SAMPLE
    assert found["state"].startswith(f"{record.times[SAMPLE]:.1f} s, objects in the largest cluster")
    expected = [[record.columns[f"r{i}_{key}"][SAMPLE] for key in ("x", "y", "heading")] for i in range(2)]
    assert found["robots"] == expected
    assert found["corner"] == [0, 0, 0, 0]
    assert all(pixel[3] == 255 for pixel in found["pixels"])  # the robots are drawn at their positions
    assert found["playing"] == "Pause record"
    assert found["after"] == len(record.times) - 1
    assert found["end"] == "Play record"


SHOWN = """<pre id="result"></pre><script>
show(%d);
const at = (c, x, y) => [...c.getImageData(Math.round(x), Math.round(y), 1, 1).data].slice(0, 3);
const r = d.robots[0], a = r.heading[sample], ahead = d.bodies[0].radius + 1.5;
document.getElementById("result").textContent = JSON.stringify({
  log: document.getElementById("log").textContent,
  strip: [0, 10, 19].map(p => at(h, 20 + p * STRIP_PIXEL + 5, 7)),
  front: at(g, X(r.x[sample] + ahead * Math.cos(a)), Y(r.y[sample] + ahead * Math.sin(a))),
  later: lit(0), seen: d.robots.map(r => r.seen[sample])});
</script></html>"""


@needs_browser
def test_the_page_shows_strips_leds_and_what_was_said(trial: Path, tmp_path: Path) -> None:
    """The page shows a short pulse of the front LED, a line of text, and a camera line in three colours."""
    record = read_trial(trial)
    record.columns["log"][SAMPLE] = [{"robot": 0, "cycle": 49_152_000, "text": "hello"}]
    record.columns["lights"][SAMPLE] = [{"robot": 0, "cycle": 49_152_001, "leds": 256},
                                        {"robot": 0, "cycle": 49_153_000, "leds": 0}]  # fmt: skip
    record.columns["r0_strip"][SAMPLE] = bytes([90, 14, 14] * 10 + [10, 48, 14] * 5 + [112, 100, 100] * 5)
    record.columns["r0_seen"] = np.full(len(record.times), -1)
    found = run_probe(page(record), SHOWN % SAMPLE, tmp_path)
    assert found["strip"] == [[90, 14, 14], [10, 48, 14], [112, 100, 100]]
    assert found["later"] == 256
    assert found["front"] == pytest.approx([255, 187, 0], abs=20)  # the edge of the disc is antialiased
    lines = found["log"].splitlines()
    assert lines[0].endswith("robot 0  LEDs off")
    assert lines[1].endswith("robot 0  LEDs front")
    assert lines[2] == "3.333 s  robot 0  hello"
    assert found["seen"][0] in (0, 1, 2)  # computed from the poses


LAYOUT = """<pre id="result"></pre><script>
const box = name => {
  const r = document.getElementById(name).getBoundingClientRect();
  return [r.left, r.top, r.right, r.bottom];
};
const found = {inner: [innerWidth, innerHeight], ratio: devicePixelRatio, boxes: {}};
for (const name of ["play", "scrub", "speed", "state", "view", "plot", "log", "chosen"])
  found.boxes[name] = box(name);
found.canvas = [canvas.width, canvas.clientWidth];
found.legend = document.getElementById("legend").textContent;
const press = (key, shiftKey) => document.dispatchEvent(new KeyboardEvent("keydown", {key, shiftKey, bubbles: true}));
press("ArrowRight"); press("ArrowRight"); press("ArrowLeft"); found.one = sample;
press("ArrowRight", true); found.eleven = sample;
press("End"); found.end = sample; press("Home"); found.home = sample;
press("t"); found.trails = document.getElementById("trails").checked;
press("n"); press("n"); found.second = [chosen, document.getElementById("chosen").textContent];
press("Escape"); found.none = chosen;
press("?"); found.help = document.getElementById("help").hidden;
show(4);
const r0 = d.robots[0];
const c = canvas.getBoundingClientRect();
canvas.dispatchEvent(new MouseEvent("click", {clientX: c.left + X(r0.x[4]) + 2, clientY: c.top + Y(r0.y[4])}));
found.clicked = chosen;
const turn = {clientX: c.left + 50, clientY: c.top + 60, deltaY: -1, cancelable: true};
canvas.dispatchEvent(new WheelEvent("wheel", turn));
const under = [(50 - left) / scale, (low - 60) / scale]; found.zoom = zoom;
canvas.dispatchEvent(new WheelEvent("wheel", turn));
found.fixed = [(50 - left) / scale - under[0], (low - 60) / scale - under[1]];
press("f"); const [x0, y0] = pose(0, share());
found.tracked = [X(x0) - canvas.clientWidth / 2, Y(y0) - (canvas.clientHeight - 16) / 2];
press("0"); found.whole = [zoom, panX, panY];
press("s"); found.sensors = document.getElementById("sensors").checked;
const focused = (id, key) => {           // whether the page leaves a key to the element that has the focus
  const event = new KeyboardEvent("keydown", {key, bubbles: true, cancelable: true});
  return document.getElementById(id).dispatchEvent(event) && !playing;
};
const keys = [["trails", " "], ["keys", " "], ["scrub", "PageDown"], ["scrub", "End"], ["speed", "t"]];
found.native = keys.map(([id, key]) => focused(id, key));
show(4); if (chosen < 0) press("n");
const half = clock = (d.t[4] + d.t[5]) / 2;
found.between = [share(), pose(0, share())[0], (r0.x[4] + r0.x[5]) / 2];
press(" "); found.playing = playing; press(" ");
const p = document.getElementById("plot").getBoundingClientRect();
const middle = {clientX: p.left + p.width / 2, clientY: p.top + 20};
document.getElementById("plot").dispatchEvent(new MouseEvent("click", middle));
found.sought = d.t[sample] / d.t[d.t.length - 1];
document.getElementById("result").textContent = JSON.stringify(found);
</script></html>"""


@needs_browser
@pytest.mark.parametrize("size", ["1280,720", "700,900"])
def test_everything_can_be_reached_by_hand_and_key(trial: Path, tmp_path: Path, size: str) -> None:
    """All controls and views fit on the screen, keys and clicks work, and robots are interpolated between samples."""
    found = run_probe(page(read_trial(trial)), LAYOUT, tmp_path, size)
    width, height = found["inner"]
    for name, (left, top, right, bottom) in found["boxes"].items():
        assert (left >= 0, top >= 0, right <= width, bottom <= height) == (True,) * 4, (name, size, found["inner"])
        assert (right - left > 5, bottom - top > 5) == (True, True), name
    assert found["canvas"][0] == found["canvas"][1] * found["ratio"]
    assert "robot sees nothing" in found["legend"]
    assert "objects of one group" in found["legend"]
    assert (found["one"], found["eleven"], found["home"]) == (1, 11, 0)
    assert found["end"] == 16
    assert found["trails"] is True
    assert found["second"][0] == 1
    assert found["second"][1].startswith("robot 1  at ")
    assert (found["none"], found["help"], found["clicked"], found["playing"]) == (-1, False, 0, True)
    assert found["zoom"] == pytest.approx(1.2)
    assert found["fixed"] == pytest.approx([0, 0], abs=1e-6)
    assert found["tracked"] == pytest.approx([0, 0], abs=1e-6)
    assert (found["whole"], found["sensors"]) == ([1, 0, 0], True)
    assert found["native"] == [True] * 5
    share, x, middle = found["between"]
    assert (share, x) == pytest.approx((0.5, middle))
    assert found["sought"] == pytest.approx(0.5, abs=0.05)


MANY = """<pre id="result"></pre><script>
const found = {};
while (d.robots.length < 10000) { d.robots.push(d.robots[0]); d.bodies.push(d.bodies[0]); d.names.push(""); }
layout();
const seen = el("seen"), ratio = devicePixelRatio || 1;
const strip = row => {
  const y = (row * STRIP_HEIGHT - seen.scrollTop + 7) * ratio;
  return [...h.getImageData(24 * ratio, y, 1, 1).data].slice(0, 3);
};
found.height = strips.height; found.rows = el("rows").offsetHeight; found.top = strip(0);
choose(9000); found.scrolled = seen.scrollTop / STRIP_HEIGHT; found.chosen = strip(9000);
seen.scrollTop = 1e9; drawStrips(); found.last = strip(9999);
found.width = [document.documentElement.scrollWidth, innerWidth];
zoomed(1 / 1.2, 100, 100); found.zoom = zoom;
document.getElementById("result").textContent = JSON.stringify(found);
</script></html>"""


@needs_browser
@pytest.mark.parametrize(("size", "has_walls"), [("1400,900", True), ("500,900", False)])
def test_a_page_of_ten_thousand_robots(trial: Path, tmp_path: Path, size: str, has_walls: bool) -> None:
    """The canvas of camera lines has the rows on screen only, and they scroll; a world without walls zooms out."""
    record = read_trial(trial)
    line = bytes([90, 14, 14] * 20)
    record.columns["r0_strip"][:] = [line] * len(record.times)
    text = page(record).replace('"walls":true', f'"walls":{str(has_walls).lower()}')
    found = run_probe(text, MANY, tmp_path, size)
    assert found["rows"] == 140_000
    assert found["height"] < 2_000
    assert (found["top"], found["chosen"], found["last"]) == ([90, 14, 14],) * 3
    assert found["scrolled"] == 9_000
    assert found["width"][0] <= found["width"][1]
    assert found["zoom"] == pytest.approx(1 if has_walls else 1 / 1.2)


POLICY = """<pre id="result">{"own": "blocked"}</pre><script>
document.getElementById("result").textContent = JSON.stringify({own: "ran"});
</script></html>"""


@needs_browser
def test_the_policy_of_a_page_runs_its_own_script_only(trial: Path, tmp_path: Path) -> None:
    """The page's script sets the title; a script that is not the page's does not run."""
    path = tmp_path / "policy.html"
    path.write_text(page(read_trial(trial)).replace("</html>", POLICY))
    command = [str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
               "--virtual-time-budget=4000", "--dump-dom", path.as_uri()]  # fmt: skip
    shown = subprocess.run(command, capture_output=True, text=True, timeout=HANG, check=False).stdout
    assert '{"own": "blocked"}' in shown
    assert re.search("<title>[^<]*, seed 1</title>", shown)
    assert "robot sees nothing" in shown


RETRY = """<pre id="result"></pre><script>
const status = document.getElementById("status"), found = {}, now = d.studio.now;
setTimeout(() => {
  found.lost = status.textContent;
  window.fetch = async () => ({ok: true, json: async () => ({now: {...now, tick: 7}, from: d.t.length, faults: []})});
}, 500);
setTimeout(() => {
  found.again = status.textContent; found.play = play.hidden;
  document.getElementById("result").textContent = JSON.stringify(found);
}, 3500);
</script></html>"""


@needs_browser
def test_a_studio_page_tries_again_after_a_lost_connection(trial: Path, tmp_path: Path) -> None:
    """After a failed request the page shows the delay of its next attempt; after a successful one it continues."""
    record = read_trial(trial)
    robots = [[float(record.columns[f"r{i}_{key}"][0]) for key in ("x", "y", "heading")] for i in range(2)]
    now = {"state": "paused", "tick": 3, "t": 0.0, "epoch": 0, "hit": "", "breakpoints": [], "debugger": None,
           "robots": robots, "objects": record.objects[0].tolist()}  # fmt: skip
    studio = {"header": "X-Token", "token": "t", "quantum": 0.01, "now": now}
    found = run_probe(page(record, studio=studio), RETRY, tmp_path)
    assert found["lost"] == "connection lost; next attempt in 1 s"
    assert found["again"] == "paused, quantum 7"
    assert found["play"] is True


def run_probe(text: str, probe: str, folder: Path, size: str = "1280,720") -> Any:
    """Open a page with a probe script, and return the result of the probe."""
    path = folder / "probed.html"
    path.write_text(probed(text, probe))
    command = [str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}",
               "--virtual-time-budget=4000", f"--window-size={size}", "--dump-dom", path.as_uri()]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=HANG, check=False)
    match = re.search(r'<pre id="result">(.*?)</pre>', done.stdout, re.S)
    assert match is not None, done.stderr[-2000:]
    return json.loads(match.group(1).replace("&amp;", "&"))
