#!/usr/bin/env python3
"""Opens the page of scripts/web.sh in a Chromium without a window.

    scripts/web/headless.py FOLDER OUT.png [KEY=VALUE ...]          saves the picture that the page computes
    scripts/web/headless.py --open FOLDER OUT.png [KEY=VALUE ...]   uses the viewer: drags, presses keys, takes a picture
                                                                    of the page, loses the device; fails where that has
                                                                    no effect, or another than it should
    scripts/web/headless.py --refuse FOLDER                         opens it where the browser gives no adapter

The page's address gets the keys (frames=8 size=480x360). Runs on the CPU (SwiftShader). Exit code 1 if the page fails.
Standard library only: Chromium is driven through a pipe.
"""

import base64
import contextlib
import functools
import http.server
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import time
import urllib.parse
import zlib

# WebGPU, and what composes the page, on the same SwiftShader: otherwise no image is found that both can use, and the first frame
# that a canvas shows takes the device away ("Could not find SharedImageBackingFactory"). A graphics process that has crashed is started
# again however often, and pages keep WebGPU: by default the second crash takes it from them.
FLAGS = """--headless=new --no-sandbox --disable-dev-shm-usage --enable-unsafe-webgpu --enable-features=Vulkan
--use-vulkan=swiftshader --use-webgpu-adapter=swiftshader --use-angle=swiftshader --enable-unsafe-swiftshader
--ignore-gpu-blocklist --disable-gpu-process-crash-limit --disable-domain-blocking-for-3d-apis
--force-color-profile=srgb --remote-debugging-pipe --no-first-run""".split()
# As in runtime/viewer/src/window.rs.
MOST_LOSSES = 3
PATIENCE_S = float(os.environ.get("PATIENCE_S", 300))


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


class Chromium:
    """Speaks the DevTools protocol: JSON messages that end in a zero byte."""

    def __init__(self, profile):
        names = ["chromium", "chromium-browser", "google-chrome", "chrome"]
        program = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, names)), None)
        if program is None:
            sys.exit("headless: there is no Chromium; name it with CHROMIUM=")
        to_read, self.out = os.pipe()
        self.into, to_write = os.pipe()

        def adopt():
            # Chromium reads descriptor 3 and writes 4.
            read, write = os.dup(to_read), os.dup(to_write)
            os.dup2(read, 3)
            os.dup2(write, 4)

        command = [program, *FLAGS, f"--user-data-dir={profile}", "about:blank"]
        self.process = subprocess.Popen(command, preexec_fn=adopt, close_fds=False, stderr=subprocess.DEVNULL)
        os.close(to_read)
        os.close(to_write)
        self.rest = b""
        self.number = 0
        self.attached = None
        self.target = None
        # Errors of the page: exceptions, and what it has told the console.
        self.errors = []

    def message(self):
        while b"\0" not in self.rest:
            chunk = os.read(self.into, 1 << 20)
            if not chunk:
                sys.exit("headless: Chromium has ended")
            self.rest += chunk
        line, self.rest = self.rest.split(b"\0", 1)
        return json.loads(line)

    def call(self, method, **params):
        self.number += 1
        request = {"id": self.number, "method": method, "params": params}
        if self.attached:
            request["sessionId"] = self.attached
        os.write(self.out, json.dumps(request).encode() + b"\0")
        while True:
            answer = self.message()
            if answer.get("id") == self.number:
                if "error" in answer:
                    sys.exit(f"headless: {method}: {answer['error']}")
                return answer["result"]
            self.tell(answer)

    def tell(self, event):
        params = event.get("params", {})
        if event.get("method") == "Runtime.consoleAPICalled":
            text = " ".join(str(each.get("value", each.get("description"))) for each in params["args"])
            print(f"console {params['type']}: {text}", file=sys.stderr)
            if params["type"] == "error":
                self.errors.append(text)
        elif event.get("method") == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            text = details.get("exception", {}).get("description", details["text"])
            print(f"exception: {text}", file=sys.stderr)
            self.errors.append(text)
        elif event.get("method") == "Log.entryAdded":
            print(f"log {params['entry']['level']}: {params['entry']['text']}", file=sys.stderr)

    def value(self, expression):
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            sys.exit(f"headless: {expression}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def open(self, address, before=""):
        """A page of 960 x 540 pixels; `before` runs in it before its own scripts."""
        if self.target:
            self.attached = None
            self.call("Target.closeTarget", targetId=self.target)
        target = self.target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.attached = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ["Runtime", "Log", "Page"]:
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=960, height=540, deviceScaleFactor=1, mobile=False)
        self.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        self.call("Page.navigate", url=address)

    def await_state(self, wanted, during="loading"):
        end = time.monotonic() + PATIENCE_S
        while (state := self.value("window.localprt?.state ?? 'loading'")) in ("loading", during):
            if time.monotonic() > end:
                sys.exit(f"headless: the page was not {wanted} within {PATIENCE_S:.0f} s")
            time.sleep(0.25)
        if state != wanted:
            sys.exit(f"headless: {state}: {self.value('window.localprt.message')}")

    def mouse(self, kind, x, y, buttons=0):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, buttons=buttons, clickCount=1,
                  button="none" if kind == "mouseMoved" and not buttons else "left")

    def key(self, key, code, number):
        for kind in ["keyDown", "keyUp"]:
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code, windowsVirtualKeyCode=number)

    def screenshot(self, **clip):
        area = {"clip": {**clip, "scale": 1}} if clip else {}
        return base64.b64decode(self.call("Page.captureScreenshot", format="png", **area)["data"])

    def lose_device(self):
        """Crashes the browser's graphics process, and every device with it."""
        page, self.attached = self.attached, None
        self.call("Browser.crashGpuProcess")
        self.attached = page

    def close(self):
        self.process.terminate()
        self.process.wait()


def png(width, height, rgba):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    rows = b"".join(b"\0" + rgba[y * width * 4 : (y + 1) * width * 4] for y in range(height))
    head = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def pixels(picture):
    """Bytes of a PNG of eight bits a channel, rows from the top."""
    at, packed = 8, b""
    while at < len(picture):
        (length,) = struct.unpack(">I", picture[at : at + 4])
        kind, data = picture[at + 4 : at + 8], picture[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, _, depth, color = struct.unpack(">IIBB", data[:10])
            step = {2: 3, 6: 4}[color] if depth == 8 else sys.exit("headless: a screenshot of another depth")
        elif kind == b"IDAT":
            packed += data
        at += 12 + length
    rows, above, length = zlib.decompress(packed), bytearray(width * step), width * step
    found = bytearray()
    for first in range(0, len(rows), length + 1):
        row = bytearray(rows[first + 1 : first + 1 + length])
        for x in range(length):
            left, up, corner = (row[x - step], above[x], above[x - step]) if x >= step else (0, above[x], 0)
            nearest = min((left, up, corner), key=lambda value: abs(left + up - corner - value))
            row[x] = (row[x] + (0, left, up, (left + up) // 2, nearest)[rows[first]]) & 255
        found += row
        above = row
    return found


def same(a, b):
    """Whether two pictures of light that has arrived are the same. Light is kept in halves, and its last rounding, 2^-11 of it, depends on
    how many gathers there were: an eighth of one of 255 levels, so that few pixels are off, and those by one level. Of the Cornell box one
    pixel is, at one exposure, after 64 gathers and after 65."""
    a, b = pixels(a), pixels(b)
    off = [abs(x - y) for x, y in zip(a, b) if x != y]
    return len(a) == len(b) and max(off, default=0) <= 1 and len(off) <= len(a) // 10_000


def picture(browser, out):
    browser.await_state("done")
    result = browser.value("(({ rgba, ...rest }) => rest)(window.localprt)")
    encode = """(() => { let text = "", bytes = window.localprt.rgba;
        for (let at = 0; at < bytes.length; at += 32768) text += String.fromCharCode(...bytes.slice(at, at + 32768));
        return btoa(text); })()"""
    rgba = base64.b64decode(browser.value(encode))
    with open(out, "wb") as file:
        file.write(png(result["width"], result["height"], rgba))
    print(f"{out}: {result['width']} x {result['height']}, {result['milliseconds']:.0f} ms in the page")


def use(browser, out):
    browser.await_state("open")

    def frame():
        if browser.value("window.localprt.state") != "open":
            sys.exit(f"headless: the viewer is closed: {browser.value('window.localprt.message')}")
        return json.loads(browser.value("window.localprt.viewer.lastFrame()") or "{}")

    def until(what, holds):
        end = time.monotonic() + PATIENCE_S
        while not holds(last := frame()):
            if browser.errors:
                sys.exit(f"headless: {what}: {browser.errors[0]}")
            if time.monotonic() > end:
                sys.exit(f"headless: {what}: not within {PATIENCE_S:.0f} s; the last frame: {last}")
            time.sleep(0.1)
        print(f"{what}: frame {last['frames']}, {last['gathers']} gathers")
        return last

    started = time.monotonic()
    first = until("frames come", lambda last: last.get("frames", 0) >= 8)
    print(f"8 frames in {time.monotonic() - started:.1f} s")
    # A drag over the picture, left of the panel.
    browser.mouse("mouseMoved", 200, 200)
    browser.mouse("mousePressed", 200, 200, 1)
    for step in range(1, 9):
        browser.mouse("mouseMoved", 200 + 10 * step, 200, 1)
        time.sleep(0.1)
    browser.mouse("mouseReleased", 280, 200)
    until("dragging turns the camera", lambda last: last["ahead"] != first["ahead"])
    browser.key("2", "Digit2", 50)
    until("a key shows another view", lambda last: last["view"] == "Lighting")
    browser.key("1", "Digit1", 49)
    until("and back", lambda last: last["view"] == "Final")
    # Until all bounces have arrived, after which the viewer rests.
    last = until("a still picture is not drawn again", lambda last: last["still"])
    # The picture alone: left of the panel, above what is told.
    area = {"x": 40, "y": 40, "width": 400, "height": 400}
    before = browser.screenshot(**area)
    with open(out, "wb") as file:
        file.write(browser.screenshot())
    if browser.errors:
        sys.exit(f"headless: {browser.errors[0]}")
    print(f"{out}: the page")

    for loss in range(1, MOST_LOSSES + 1):
        gathers = last["gathers"]
        browser.lose_device()
        last = until(f"loss {loss} of the device: a new one starts from darkness", lambda last: last["gathers"] < gathers)
        if "new one" not in (last["notice"] or ""):
            sys.exit(f"headless: the viewer does not tell of the loss: {last['notice']}")
        if loss == 1:
            last = until("and all bounces arrive", lambda last: last["still"])
            after = browser.screenshot(**area)
            if not same(before, after):
                for name, picture in (("before", before), ("after", after)):
                    with open(f"{out}.{name}.png", "wb") as file:
                        file.write(picture)
                sys.exit(f"headless: the picture on a new device is another one: {out}.before.png, {out}.after.png")
        else:
            last = until("and goes on", lambda last: last["gathers"] >= 4)
    browser.lose_device()
    browser.await_state("failed", during="open")
    speaks_of_browsers(browser, "lost again and again")


def refused(browser):
    browser.await_state("failed", during="open")
    speaks_of_browsers(browser, "no WebGPU device")


def speaks_of_browsers(browser, what):
    message = browser.value("window.localprt.message")
    if what not in message or "browser" not in message or "Vulkan" in message:
        sys.exit(f"headless: no message for users of browsers: {message}")
    if browser.value("document.getElementById('message').textContent") != message:
        sys.exit("headless: the page does not show its message")
    print(f"told: {message}")


@contextlib.contextmanager
def served(folder):
    """Serves a folder to this machine, and gives its address."""
    handler = functools.partial(Quiet, directory=folder)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()


@contextlib.contextmanager
def chromium():
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        with contextlib.closing(Chromium(profile)) as browser:
            yield browser


def main():
    arguments = sys.argv[1:]
    mode = arguments.pop(0) if arguments[:1] in (["--open"], ["--refuse"]) else "--picture"
    if len(arguments) < (1 if mode == "--refuse" else 2):
        sys.exit(__doc__)
    folder, *rest = arguments
    keys = rest[1:]
    asked = {"picture": 1} if mode == "--picture" else {}
    query = urllib.parse.urlencode({**asked, **dict(key.split("=", 1) for key in keys)})
    before = "GPU.prototype.requestAdapter = async () => null" if mode == "--refuse" else ""
    with served(folder) as address, chromium() as browser:
        browser.open(f"{address}/?{query}", before)
        match mode:
            case "--picture":
                picture(browser, rest[0])
            case "--open":
                use(browser, rest[0])
            case "--refuse":
                refused(browser)


if __name__ == "__main__":
    main()
