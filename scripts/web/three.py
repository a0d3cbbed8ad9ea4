#!/usr/bin/env python3
"""Uses the example page of runtime/three in a Chromium without a window.

    scripts/web/three.py SITE OUT pictures   OUT/NAME.png of the page and OUT/NAME.json, the same light for the viewer
    scripts/web/three.py SITE OUT use        drags the lamp; loses the device, in the page and again and again; disposes; is refused
    scripts/web/three.py SITE OUT frames N   N frames with a moving lamp and a changing emission, and what memory they leave behind

SITE holds the page, node_modules with three and localprt, and the Cornell box baked twice, cornell.lprt and
a small one, small.lprt. Exit code 1 if something is not as it should be.
"""

import json
import pathlib
import sys
import time
import urllib.parse

from headless import PATIENCE_S, chromium, served, speaks_of_browsers

WIDTH, HEIGHT = 480, 360
STILL = {"size": f"{WIDTH}x{HEIGHT}", "frames": 8, "exposure": 2, "tone": "clamp"}
# The lamp of the box, and where it goes.
LAMP, MOVED = [0, 1.5, 0], [0.5, 0.6, 0.4]
WITH_LAMP = {"type": "point", "position": LAMP, "intensity": 2.25}

# By name: how the page is asked, what is changed in it, and the same as a lighting file.
PICTURES = {
    "lamp": ({}, "", {}),
    "indirect": ({"view": "indirect"}, "", {}),
    "moved": ({}, f"lamp.position.set(...{MOVED})", {"lights": [{**WITH_LAMP, "position": MOVED}]}),
    "spot": (
        {},
        """const spot = new THREE.SpotLight(0xff8844, 6, 0, 0.5, 0.1); spot.position.set(-0.6, 1.6, 0.6);
        spot.target.position.set(0.5, 0, -0.5); spot.castShadow = true; spot.shadow.normalBias = 0.008;
        Object.assign(spot.shadow.camera, { near: 0.02, far: 8 }); scene.add(spot, spot.target); scene.remove(lamp)""",
        {"lights": [{"type": "spot", "position": [-0.6, 1.6, 0.6], "direction": [1.1, -1.6, -1.1], "color": [1, 0.246201, 0.057805],
                     "intensity": 6, "inner_cone": 0.45, "outer_cone": 0.5}]},
    ),
    "sun": (
        {},
        """const sun = new THREE.DirectionalLight(0xffffff, 2); sun.position.set(0.5, 1, 2); sun.castShadow = true;
        sun.shadow.mapSize.setScalar(1024); sun.shadow.normalBias = 0.008;
        Object.assign(sun.shadow.camera, { left: -3, right: 3, bottom: -3, top: 3, near: -6, far: 6 });
        scene.add(sun, sun.target); scene.remove(lamp)""",
        {"lights": [{"type": "directional", "direction": [-0.5, -1, -2], "intensity": 2}]},
    ),
    "emission": ({}, "material('red').emissive.setRGB(0.4, 0.1, 0.1)", {"materials": {"red": {"emission": [0.4, 0.1, 0.1]}}}),
    "sky": (
        {},
        "scene.background.setRGB(0.1, 0.2, 0.4); lamp.visible = false",
        {"lights": [], "sky": {"type": "constant", "radiance": [0.1, 0.2, 0.4]}},
    ),
}

IN_PAGE = """(async () => {{
    const {{ THREE, gpu, relit, renderer, scene, camera, lamp, frame }} = window.localprt;
    const material = (name) => {{
        let found;
        scene.traverse((object) => object.material?.name === name && (found = object.material));
        return found;
    }};
    const shown = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
    const idle = () => gpu.device.queue.onSubmittedWorkDone();
    {}
}})()"""


def fail(message):
    sys.exit(f"three: {message}")


def run(browser, body):
    result = browser.value(IN_PAGE.format(body))
    check_errors(browser)
    return result


def check_errors(browser):
    if browser.errors:
        fail(f"the page has an error: {browser.errors[0]}")


def open_page(browser, address, wanted, **keys):
    browser.open(f"{address}/?{urllib.parse.urlencode(keys)}")
    browser.await_state(wanted)
    check_errors(browser)


def screenshot(browser):
    return browser.screenshot(x=0, y=0, width=WIDTH, height=HEIGHT)


def pictures(browser, address, out):
    for name, (keys, change, lighting) in PICTURES.items():
        open_page(browser, address, "done", **STILL, **keys)
        if change:
            run(browser, f"{change}; relit.reset(); for (let at = 0; at < {STILL['frames']}; at += 1) relit.update(scene); "
                         "renderer.render(scene, camera); await shown();")
        run(browser, "await idle(); await shown();")
        (out / f"{name}.png").write_bytes(screenshot(browser))
        (out / f"{name}.json").write_text(json.dumps(lighting))
        print(f"{name}: a picture of the page")


def use(browser, address, out):
    open_page(browser, address, "open", size=STILL["size"], shadows=256)
    frames_come(browser, 3)
    before = screenshot(browser)
    x, y = run(browser, f"""const at = lamp.position.clone().project(camera);
        return [(at.x + 1) / 2 * {WIDTH}, (1 - at.y) / 2 * {HEIGHT}];""")
    browser.mouse("mouseMoved", x, y)
    time.sleep(0.5)
    browser.mouse("mousePressed", x, y, 1)
    for step in range(1, 9):
        browser.mouse("mouseMoved", x + 5 * step, y + 10 * step, 1)
        time.sleep(0.1)
    browser.mouse("mouseReleased", x + 40, y + 80)
    frames_come(browser, 8)
    place = run(browser, "return lamp.position.toArray();")
    if sum((a - b) ** 2 for a, b in zip(place, LAMP)) ** 0.5 < 0.1:
        fail(f"dragging does not move the lamp: it is at {place}")
    (out / "dragged.png").write_bytes(after := screenshot(browser))
    if after == before:
        fail("a dragged lamp leaves the picture as it was")
    print(f"dragged: the lamp is at {', '.join(f'{axis:.2f}' for axis in place)}")

    open_page(browser, address, "done", **STILL)
    run(browser, "await idle(); await shown();")
    first = screenshot(browser)
    for loss in range(1, 4):
        browser.lose_device()
        until(browser, f"window.localprt.losses === {loss} && window.localprt.state === 'done'", f"set up again after loss {loss}")
        run(browser, "await idle(); await shown();")
        if screenshot(browser) != first:
            fail(f"the picture after loss {loss} of the device is another one")
    browser.lose_device()
    browser.await_state("failed", during="done")
    print(f"lost: the same picture after each of three losses, then: {browser.value('window.localprt.message')}")

    open_page(browser, address, "done", **STILL)
    disposed = run(browser, DISPOSE)
    print(f"disposed: {json.dumps(disposed)}")
    for what, is_right in {
        "there was memory before": disposed["before"]["bufferBytes"] > 1e6 and disposed["before"]["textures"] > 0,
        "the table of the passes is within what the browser was asked for": 0 < disposed["before"]["table"],
        "none is left": disposed["after"]["buffers"] == disposed["after"]["textures"] == 0,
        "the texture is gone from the device": disposed["isDestroyed"],
        "materials have lost it": disposed["lightMaps"] == 0,
        "an update says so": "disposed" in disposed["refusal"],
        "scenes that come and go leave no memory of WebAssembly behind": disposed["grown"] == 0,
        "another scene is lit": disposed["lit"] > 0,
    }.items():
        if not is_right:
            fail(f"dispose: not so: {what}")

    browser.open(f"{address}/", "GPU.prototype.requestAdapter = async () => null")
    browser.await_state("failed")
    speaks_of_browsers(browser, "no WebGPU adapter")


DISPOSE = """
    const keep = relit.memory, texture = relit.lightMap.sourceTexture;
    const table = Object.values(keep.byPurpose).reduce((sum, bytes) => sum + bytes, 0);
    relit.dispose();
    renderer.render(scene, camera);
    const read = gpu.device.createBuffer({ size: 1024, usage: GPUBufferUsage.COPY_DST });
    gpu.device.pushErrorScope("validation");
    const encoder = gpu.device.createCommandEncoder();
    encoder.copyTextureToBuffer({ texture }, { buffer: read }, [1, 1]);
    gpu.device.queue.submit([encoder.finish()]);
    const isDestroyed = (await gpu.device.popErrorScope()) !== null;
    let refusal = "", lightMaps = 0, lit = 0;
    try { relit.update(scene); } catch (error) { refusal = error.message; }
    scene.traverse((object) => (lightMaps += object.material?.lightMap ? 1 : 0));
    let grown;
    for (let round = 0; round < 4; round += 1) {
        const other = await gpu.load("cornell.lprt");
        lit = other.applyTo(scene);
        other.update(scene);
        renderer.render(scene, camera);
        if (round === 1) grown = -other.memory.webAssembly;
        if (round === 3) grown += other.memory.webAssembly;
        other.dispose();
    }
    renderer.render(scene, camera);
    await idle();
    return { before: { ...keep, table }, after: relit.memory, isDestroyed, refusal, lightMaps, grown, lit };
"""


def frames(browser, address, n_frames):
    open_page(browser, address, "done", scene="small", size="96x72", frames=1, shadows=256)
    # What is compiled and collected late is there before the first measure.
    draw(browser, 100)
    before = memory(browser)
    started = time.monotonic()
    draw(browser, n_frames)
    seconds = time.monotonic() - started
    after = memory(browser)
    print(f"{n_frames} frames in {seconds:.0f} s; before {json.dumps(before)}; after {json.dumps(after)}")
    for what in ["buffers", "bufferBytes", "textures", "webAssembly", "threeTextures", "threeGeometries"]:
        if after[what] > before[what]:
            fail(f"{n_frames} frames leave memory behind: {what} was {before[what]}, is {after[what]}")
    # A byte a frame of each of some hundred objects would be seen; caches of the browser's compiler are less.
    if after["heap"] - before["heap"] > 1000 * n_frames:
        fail(f"{n_frames} frames leave {after['heap'] - before['heap']} bytes of JavaScript behind")


def draw(browser, n_frames):
    run(browser, f"""for (let at = 0; at < {n_frames}; at += 1) {{
            lamp.position.set(0.5 * Math.cos(0.1 * at), 1.2 + 0.3 * Math.sin(0.07 * at), 0.5 * Math.sin(0.1 * at));
            material("red").emissive.setRGB(0.2 + 0.2 * Math.sin(0.1 * at), 0, 0);
            frame();
            if (at % 8 === 7) await idle();
        }}
        await idle();""")


def memory(browser):
    for _ in range(3):
        browser.call("HeapProfiler.collectGarbage")
        time.sleep(0.2)
    held = run(browser, """const { byPurpose, ...sums } = relit.memory, of = renderer.info.memory;
        return { ...sums, threeTextures: of.textures, threeGeometries: of.geometries };""")
    return {**held, "heap": int(browser.call("Runtime.getHeapUsage")["usedSize"])}


def frames_come(browser, more):
    last = browser.value("window.localprt.frames")
    until(browser, f"window.localprt.frames >= {last + more}", "frames come")


def until(browser, condition, what):
    end = time.monotonic() + PATIENCE_S
    while not browser.value(condition):
        check_errors(browser)
        if browser.value("window.localprt.state") == "failed":
            fail(f"{what}: {browser.value('window.localprt.message')}")
        if time.monotonic() > end:
            fail(f"{what}: not within {PATIENCE_S:.0f} s")
        time.sleep(0.1)


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    site, out, mode, *rest = sys.argv[1:]
    with served(site) as address, chromium() as browser:
        match mode:
            case "pictures":
                pictures(browser, address, pathlib.Path(out))
            case "use":
                use(browser, address, pathlib.Path(out))
            case "frames":
                frames(browser, address, int(rest[0]))
            case _:
                sys.exit(__doc__)


if __name__ == "__main__":
    main()
