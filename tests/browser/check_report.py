#!/usr/bin/env python3
"""Opens a report.html in headless Chromium without a network and checks what a reader would see.

    check_report.py REPORT.html [--figures N] [--lines N] [--screenshots DIR] [--pdf FILE]

Needs Debian's chromium and chromium-driver, and nothing beyond Python's standard library. Checks, at
1280 and 800 px: every figure is drawn, with as many lines and event lines as the page's data holds; no
message on the console; no request to any host; nothing wider than the window; labels within each figure
apart. Then, with the mouse: a click on a legend entry hides its line (or its group of lines), another brings
it back; pointing at a figure (at a mark, where there is no common axis) shows values. Exit code 0 if all holds, 1 if not, 2 if the browser cannot be run.
"""

import argparse
import base64
import json
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

WIDTHS = (1280, 800)
MAX_FINDINGS = 40

# What is drawn, figure by figure. Nodes that hold no text or have no extent cannot collide.
SURVEY = """
const page = JSON.parse(document.getElementById('figure-data').textContent);
// A long legend scrolls within its frame: what is scrolled away is not seen.
const seen = (e) => {
  const legend = e.closest('.legend');
  if (!legend) return true;
  const [r, frame] = [e.getBoundingClientRect(), legend.querySelector('.bg').getBoundingClientRect()];
  return r.top >= frame.top - 2 && r.bottom <= frame.bottom + 2;
};
const boxes = (plot, selector) => [...plot.querySelectorAll(selector)].filter(seen)
  .filter((e) => e.textContent.trim() !== '')
  .map((e) => ({ text: e.textContent, r: e.getBoundingClientRect() }))
  .filter(({ r }) => r.width > 0 && r.height > 0)
  .map(({ text, r }) => ({ text, left: r.left, right: r.right, top: r.top, bottom: r.bottom }));
return {
  drawn: Number(document.documentElement.dataset.figuresDrawn || 0),
  wide: document.documentElement.scrollWidth - window.innerWidth,
  mathjax: typeof window.MathJax,
  figures: page.figures.map((figure) => {
    const plot = document.getElementById(figure.id);
    const frame = plot.getBoundingClientRect();
    const visible = (path) => { const r = path.getBoundingClientRect(); return r.width + r.height > 0; };
    return {
      id: figure.id,
      title: plot.closest('figure').querySelector('figcaption').textContent,
      traces: figure.data.filter((t) => t.mode === 'lines').length,
      empty: figure.data.filter((t) => t.mode === 'lines' && !t.y.some((v) => v !== null)).length,
      legend: figure.layout.showlegend !== false,
      overAxis: figure.layout.hovermode === 'x unified' || figure.x !== undefined,
      // What the first entry of the legend stands for.
      first: figure.data.filter((t) => t.mode === 'lines'
        && (t === figure.data[0] || (t.legendgroup && t.legendgroup === figure.data[0].legendgroup))).length,
      events: (figure.layout.shapes || []).filter((s) => s.type === 'line').length,
      lines: [...plot.querySelectorAll('.scatterlayer path.js-line')].filter(visible).length,
      eventLines: [...plot.querySelectorAll('.shapelayer path')].filter((p) => /^M[^ML]+L[^L]+$/.test(p.getAttribute('d') || '')).length,
      frame: { left: frame.left, right: frame.right, top: frame.top, bottom: frame.bottom },
      labels: boxes(plot, '.annotation-text, .xtick text, .ytick text, .g-xtitle text, .g-ytitle text, .legendtext'),
    };
  }),
};
"""

CENTRES = """
const plot = document.getElementById(arguments[0]);
plot.scrollIntoView({ block: 'center' });
const centre = (e) => { const r = e.getBoundingClientRect(); return [Math.round(r.left + r.width / 2), Math.round(r.top + r.height / 2)]; };
const toggle = plot.querySelector('.legendtoggle');
const marks = [...plot.querySelectorAll('.scatterlayer .points path')].filter((p) => getComputedStyle(p).opacity > 0);
const area = arguments[1] || marks.length === 0 ? plot.querySelector('.nsewdrag') : marks[0];
return { toggle: toggle && centre(toggle), area: area && centre(area) };
"""

LINES = """
return [...document.getElementById(arguments[0]).querySelectorAll('.scatterlayer path.js-line')]
  .filter((p) => { const r = p.getBoundingClientRect(); return r.width + r.height > 0; }).length;
"""

HOVER = "return document.getElementById(arguments[0]).querySelector('.hoverlayer').textContent;"

IMAGE = """
const done = arguments[arguments.length - 1];
Plotly.toImage(document.getElementById(arguments[0]), { format: 'png', width: 800, height: 300 })
  .then((url) => done(url.length), (error) => done(String(error)));
"""


class Browser:
    """A Chromium behind its WebDriver, cut off from every network."""

    def __init__(self, folder):
        chromium = shutil.which("chromium") or shutil.which("google-chrome")
        driver = shutil.which("chromedriver")
        if not chromium or not driver:
            raise RuntimeError("chromium and chromium-driver are needed: apt-get install chromium chromium-driver")
        self.session = None
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.base = f"http://127.0.0.1:{port}"
        self.log = open(pathlib.Path(folder) / "chromedriver.log", "wb")
        # What the two leave behind when they are ended goes with the folder.
        self.process = subprocess.Popen([driver, f"--port={port}"], stdout=self.log, stderr=self.log,
                                        env={**os.environ, "TMPDIR": str(folder)})
        try:
            self.open(chromium, folder)
        except BaseException:
            self.close()
            raise

    def open(self, chromium, folder):
        arguments = [
            "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars",
            f"--user-data-dir={folder}/profile", "--host-resolver-rules=MAP * ~NOTFOUND",
            "--proxy-server=127.0.0.1:9", "--disable-background-networking", "--disable-component-update",
            "--disable-sync", "--disable-quic", "--no-first-run",
            # A machine without a mouse would keep the figures' tool bars open.
            "--blink-settings=primaryHoverType=2,availableHoverTypes=2,primaryPointerType=4,availablePointerTypes=4",
        ]
        options = {"binary": chromium, "args": arguments}
        capabilities = {
            "goog:chromeOptions": options,
            "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
            "timeouts": {"script": 60000, "pageLoad": 120000},
        }
        for attempt in range(100):
            try:
                self.call("GET", "/status")
                break
            except urllib.error.URLError:
                time.sleep(0.1)
        self.session = self.call("POST", "/session", {"capabilities": {"alwaysMatch": capabilities}})["sessionId"]

    def call(self, method, path, body=None):
        data = None if method == "GET" else json.dumps(body or {}).encode()
        request = urllib.request.Request(self.base + path, data, {"Content-Type": "application/json"}, method=method)
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        try:
            with opener.open(request, timeout=180) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            detail = json.load(error).get("value", {}).get("message", "")
            raise RuntimeError(f"{method} {path}: {detail.splitlines()[0] if detail else error}") from error

    def do(self, path, body=None, method="POST"):
        return self.call(method, f"/session/{self.session}{path}", body)

    def script(self, text, *arguments, kind="sync"):
        return self.do(f"/execute/{kind}", {"script": text, "args": list(arguments)})

    def resize(self, width):
        # The window's own frame differs between versions; this sets what the page sees.
        metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        self.do("/goog/cdp/execute", {"cmd": "Emulation.setDeviceMetricsOverride", "params": metrics})

    def point(self, place, click=False):
        actions = [{"type": "pointerMove", "duration": 60, "x": place[0] - 3, "y": place[1]},
                   {"type": "pointerMove", "duration": 60, "x": place[0], "y": place[1]}]
        if click:
            actions += [{"type": "pointerDown", "button": 0}, {"type": "pause", "duration": 40},
                        {"type": "pointerUp", "button": 0}]
        self.do("/actions", {"actions": [{"type": "pointer", "id": "mouse", "parameters": {"pointerType": "mouse"},
                                          "actions": actions}]})

    def close(self):
        try:
            if self.session:
                self.call("DELETE", f"/session/{self.session}")
        finally:
            self.process.terminate()
            try:
                self.process.wait(10)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
            self.log.close()


def started(folder, attempts=3):
    """A browser that has started. One that does not is nothing that the report could help, and is tried again."""
    for attempt in range(1, attempts + 1):
        place = pathlib.Path(folder) / f"browser-{attempt}"
        place.mkdir()
        try:
            return Browser(place)
        except (RuntimeError, OSError) as error:
            log = place / "chromedriver.log"
            said = log.read_text(errors="replace").splitlines()[-5:] if log.exists() else []
            print(f"browser, start {attempt} of {attempts}: {error}", *said, sep="\n  ", file=sys.stderr)
            if attempt == attempts or not log.exists():
                raise


def wait_for(question, seconds=5.0):
    """Asks until the answer is true or time is up; the last answer."""
    end = time.monotonic() + seconds
    while not question():
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


def overlaps(labels):
    """Pairs of labels that cover each other by more than a rounded pixel or two."""
    pairs = []
    for i, a in enumerate(labels):
        for b in labels[:i]:
            wide = min(a["right"], b["right"]) - max(a["left"], b["left"])
            high = min(a["bottom"], b["bottom"]) - max(a["top"], b["top"])
            if wide > 2 and high > 3:
                pairs.append((b["text"], a["text"]))
    return pairs


def check_drawing(browser, width, options, fail):
    survey = browser.script(SURVEY)
    figures = survey["figures"]
    if survey["drawn"] != len(figures):
        fail(f"{width} px: {survey['drawn']} of {len(figures)} figures drawn")
    if options.figures is not None and len(figures) != options.figures:
        fail(f"{len(figures)} figures, expected {options.figures}")
    if survey["mathjax"] != "undefined":
        fail("MathJax is loaded")
    if survey["wide"] > 0:
        fail(f"{width} px: the page is {survey['wide']} px wider than the window")
    for figure in figures:
        name = f"{width} px, {figure['id']} `{figure['title']}`"
        expected = figure["traces"] - figure["empty"]
        if figure["lines"] != expected:
            fail(f"{name}: {figure['lines']} lines drawn, expected {expected}")
        if options.lines is not None and figure["legend"] and figure["overAxis"] and figure["lines"] != options.lines:
            fail(f"{name}: {figure['lines']} lines drawn, expected {options.lines}")
        if figure["legend"] and figure["eventLines"] != figure["events"]:
            fail(f"{name}: {figure['eventLines']} event lines drawn, expected {figure['events']}")
        for a, b in overlaps(figure["labels"]):
            fail(f"{name}: labels overlap: {a!r} and {b!r}")
        frame = figure["frame"]
        for label in figure["labels"]:
            out = max(frame["left"] - label["left"], label["right"] - frame["right"],
                      frame["top"] - label["top"], label["bottom"] - frame["bottom"])
            if out > 2:
                fail(f"{name}: label {label['text']!r} reaches {out:.0f} px out of the figure")
    return figures


def check_mouse(browser, figures, fail):
    toggled = pointed = 0
    for figure in figures:
        if not figure["legend"] or figure["lines"] == 0:
            continue
        key, name = figure["id"], f"{figure['id']} `{figure['title']}`"
        places = browser.script(CENTRES, key, figure["overAxis"])
        before = figure["lines"]
        browser.point(places["area"])
        if wait_for(lambda: any(c.isdigit() for c in browser.script(HOVER, key))):
            pointed += 1
        else:
            fail(f"{name}: pointing at the figure shows no values")
        # The legend waits 300 ms for a double click before it acts.
        browser.point(places["toggle"], click=True)
        if not wait_for(lambda: browser.script(LINES, key) == before - figure["first"]):
            fail(f"{name}: a click on the legend left {browser.script(LINES, key)} of {before} lines, "
                 f"expected {figure['first']} fewer")
            continue
        time.sleep(0.4)
        browser.point(places["toggle"], click=True)
        if wait_for(lambda: browser.script(LINES, key) == before):
            toggled += 1
        else:
            fail(f"{name}: a second click did not bring the line back")
    return toggled, pointed


def check_quiet(browser, fail):
    """Neither messages on the console nor requests beyond the file itself."""
    for entry in browser.do("/se/log", {"type": "browser"}):
        if entry["level"] in ("SEVERE", "WARNING"):
            fail(f"console: {entry['message'][:300]}")
    requests = 0
    for entry in browser.do("/se/log", {"type": "performance"}):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            requests += 1
            address = message["params"]["request"]["url"]
            if not address.startswith(("file:", "data:", "blob:")):
                fail(f"request to {address[:200]}")
        elif message["method"] == "Network.webSocketCreated":
            fail(f"web socket to {message['params']['url'][:200]}")
    return requests


def screenshot(browser, path, width):
    height = browser.script("return document.documentElement.scrollHeight")
    clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
    shot = browser.do("/goog/cdp/execute", {"cmd": "Page.captureScreenshot",
                                            "params": {"captureBeyondViewport": True, "clip": clip}})
    path.write_bytes(base64.b64decode(shot["data"]))


def run(options, folder):
    failures = []
    browser = started(folder)
    try:
        browser.resize(WIDTHS[0])
        # The browser's own start page loads much; what follows is the report's.
        browser.do("/url", {"url": "about:blank"})
        for kind in ("browser", "performance"):
            browser.do("/se/log", {"type": kind})
        start = time.monotonic()
        browser.do("/url", {"url": options.report.resolve().as_uri()})
        drawn = wait_for(lambda: browser.script("return document.documentElement.dataset.figuresDrawn") is not None, 60)
        seconds = time.monotonic() - start
        if not drawn:
            failures.append("the figures are not drawn after 60 s")
        figures = []
        for width in WIDTHS:
            browser.resize(width)
            time.sleep(1.0)
            figures = check_drawing(browser, width, options, failures.append)
            if options.screenshots:
                options.screenshots.mkdir(parents=True, exist_ok=True)
                screenshot(browser, options.screenshots / f"report-{width}.png", width)
        browser.resize(WIDTHS[0])
        time.sleep(1.0)
        toggled, pointed = check_mouse(browser, figures, failures.append)
        if figures:
            size = browser.script(IMAGE, figures[0]["id"], kind="async")
            if not isinstance(size, int) or size < 2000:
                failures.append(f"{figures[0]['id']} cannot be saved as an image: {size}")
        if options.pdf:
            options.pdf.write_bytes(base64.b64decode(browser.do("/print", {"background": True})))
        requests = check_quiet(browser, failures.append)
    finally:
        browser.close()
    if failures:
        print(f"{options.report.name}: not as it should be ({len(failures)} findings)")
        for failure in failures[:MAX_FINDINGS]:
            print(f"  - {failure}")
        if len(failures) > MAX_FINDINGS:
            print(f"  and {len(failures) - MAX_FINDINGS} more")
        return 1
    lines = sum(f["lines"] for f in figures)
    print(f"{options.report.name}: {options.report.stat().st_size / 1e6:.1f} MB, drawn in {seconds:.1f} s; "
          f"{len(figures)} figures, {lines} lines; {toggled} legends toggled, {pointed} figures pointed at; "
          f"{requests} requests, none to a host; console silent")
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("report", type=pathlib.Path)
    parser.add_argument("--figures", type=int, help="number of figures that the page must have")
    parser.add_argument("--lines", type=int, help="number of lines that each figure with a legend must have")
    parser.add_argument("--screenshots", type=pathlib.Path, help="folder for a picture at each width")
    parser.add_argument("--pdf", type=pathlib.Path, help="where to print the page to")
    options = parser.parse_args()
    if not options.report.is_file():
        print(f"{options.report}: no such file")
        return 2
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        try:
            return run(options, folder)
        except (RuntimeError, OSError) as error:
            print(f"the browser cannot be run: {error}")
            return 2


if __name__ == "__main__":
    sys.exit(main())
