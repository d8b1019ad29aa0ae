# The live page as visitors see it. The gate presses by mouse, leaves the page, and ends its servers. Driven by
# test_web.sh.
import json
import os
import struct
import subprocess
import sys
import time
from served import Browser, Bus, Served, check, opened, until
import served as results

ARTEFACTS = os.environ.get("KN_ARTEFACTS", os.environ["KN_BUILD"] + "/tests")
NIGHT = "KN_NIGHT" in os.environ
TOP = [0.5, 0.4]  # in shares of the picture: the middle of the block's top, set once the page has drawn

# Elements that must be legible against their background (WCAG 2.1 AA), if they are shown.
CONTRAST = """
const channels = (c) => c.match(/[\\d.]+/g).map(Number);
const linear = (x) => x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
const light = (c) => [0.2126, 0.7152, 0.0722].reduce((sum, k, i) => sum + k * linear(channels(c)[i] / 255), 0);
const ground = (e) => {
    const c = getComputedStyle(e).backgroundColor;
    return channels(c)[3] === 0 ? ground(e.parentElement) : c;
};
const ratio = (a, b) => (Math.max(light(a), light(b)) + 0.05) / (Math.min(light(a), light(b)) + 0.05);
return [...document.querySelectorAll('body *')]
    .filter((e) => e.offsetParent && [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim()))
    .map((e) => [ratio(getComputedStyle(e).color, ground(e)), e.id || e.tagName])
    .concat([[1.5 * ratio(getComputedStyle(reset).borderColor, ground(reset)), 'edge of reset']]) // 3 is enough for it
    .sort((a, b) => a[0] - b[0])"""


def begun(page, begin, end):  # press until the force rises; press again if a watchdog that a stall tripped bars the press
    for _ in range(4):
        begin()
        until(lambda: page.now()["force_n"] > 0.5 or "press again" in page.now()["status"])
        if "press again" not in page.now()["status"]:
            return page.now()["force_n"] > 0.5
        end()
        until(lambda: page.now()["status"].startswith("ready"))
    return False


def pressed(page, bus, sentence, begin, end):  # begin a press, watch it, end it
    bus_before = bus.dent_mm()
    check(f"{sentence}: the force rises", begun(page, begin, end), page.now())
    check(f"{sentence}: the tool is as deep as the slider says", until(lambda: abs(page.now()["depth_mm"] - 5) < 0.3),
          page.text("depth-now"), page.now())
    check(f"{sentence}: the page describes the press in words",
          until(lambda: page.text("contact") == "touching" and page.text("level") == "Live"),
          page.text("contact"), page.text("status"))
    end()
    check(f"{sentence}: after the release the force is zero",
          until(lambda: page.now()["force_n"] == 0 and not page.now()["contact"]), page.now())
    check(f"{sentence}: the dent stays", until(lambda: bus.dent_mm() > bus_before + 0.5), bus_before, bus.dent_mm())


def reset(page, bus, how):
    generation = bus.generation
    how()
    check("reset: the dent is gone", until(lambda: bus.generation != generation and bus.dent_mm() < 0.01),
          generation, bus.generation, bus.dent_mm())
    check("reset: the object can be pressed again", until(lambda: page.now()["status"].startswith("ready")), page.now())


def by_mouse(page, bus):
    page.hover(*TOP)
    check("the tool is ready", until(lambda: page.now().get("status", "").startswith("ready")), page.now())
    time.sleep(1)
    page.keep("new")
    page.mouse("Pressed", page.x, page.y, button="right", held=2)
    time.sleep(0.5)
    check("the right button presses nothing", page.now()["force_n"] == 0, page.now())
    page.mouse("Released", page.x, page.y, button="right", held=0)
    pressed(page, bus, "mouse", lambda: page.press(*TOP), page.release)
    time.sleep(1)
    page.keep("dented")
    dented = page.changed("new", "dented")
    check("the dent is visible", dented > 1000, dented)
    if NIGHT:
        stroke(page, bus, dented)


def stroke(page, bus, dented):  # a stroke, and the other actions of the mouse
    begun(page, lambda: page.press(*TOP), page.release)
    until(lambda: page.now()["depth_mm"] > 4.95)  # at rest
    wide = bus.dented()
    for i in range(8):
        page.mouse("Moved", page.x + 10, page.y)
        time.sleep(0.05)
    check("dragging the tool widens the dent", until(lambda: bus.dented() > 1.3 * wide), wide, bus.dented())
    check("dragging keeps the depth", page.now()["depth_mm"] > 4.7 and page.now()["contact"], page.now())
    page.screenshot(ARTEFACTS + "/web.png")
    page.wheel(1)
    check("the wheel moves the tool deeper", until(lambda: page.now()["depth_mm"] > 5.7), page.now())
    page.mouse("Moved", 2, 2)  # out of the picture
    page.mouse("Released", 2, 2, held=0)
    check("a release outside of the picture ends the press", until(lambda: page.now()["force_n"] == 0), page.now())
    check("the depth set by the wheel stays", page.text("depth-now") == "6.0 mm", page.text("depth-now"))

    reset(page, bus, lambda: page.run("document.getElementById('reset').click()"))
    page.hover(*TOP)

    time.sleep(6)
    poke = subprocess.run(["knead", "probe", "--path", "poke", "--hold", "0.2 s", "--quiet"],
                          capture_output=True, text=True)
    check("after 5 s without a touch another hand gets the tool", poke.returncode == 0, poke.stderr)
    reset(page, bus, lambda: page.run("document.getElementById('reset').click()"))
    page.hover(*TOP)

    def as_before():  # wait until the tool is back and drawn
        page.keep("reset")
        return page.changed("new", "reset") < dented / 20
    check("after a reset the picture is as before", until(as_before), dented, page.changed("new", "reset"))


def by_keys(page, bus):
    page.run("document.getElementById('picture').focus()")
    before = page.text("depth-now")
    for _ in range(2):
        page.key("Down", "-", "Minus", "-"), page.key("Up", "-", "Minus")
    after = page.text("depth-now")
    check("the minus key reduces the depth", before == "6.0 mm" and after == "5.0 mm", before, after)
    for _ in range(3):
        page.key("Down", "ArrowLeft"), page.key("Up", "ArrowLeft")
        time.sleep(0.05)
    time.sleep(0.5)
    pressed(page, bus, "space", lambda: page.key("Down", " ", "Space", " "), lambda: page.key("Up", " ", "Space"))
    page.key("Down", "Enter", "Enter", "\r")
    until(lambda: page.now()["depth_mm"] > 4)
    page.key("Down", "Escape")
    check("Escape ends the press", until(lambda: page.now()["force_n"] == 0), page.now())
    page.key("Up", "Enter")
    page.key("Down", " ", "Space", " ")
    until(lambda: page.now()["force_n"] > 0.1)
    page.run("document.getElementById('depth').focus()")
    check("leaving the picture by Tab ends the press", until(lambda: page.now()["force_n"] == 0), page.now())
    page.run("document.getElementById('picture').focus()")
    reset(page, bus, lambda: (page.key("Down", "r", "KeyR", "r"), page.key("Up", "r", "KeyR")))


def lose_webgl(page, bus):  # the browser takes WebGL away during a press; return what happened
    until(lambda: ready(page))
    begun(page, lambda: page.press(*TOP), page.release)
    frames = page.run("scene.gl.getExtension('WEBGL_lose_context').loseContext(); return knead.frames")
    forces, states = [bus.force_n], [page.now()]
    drawn = until(lambda: forces.append(bus.force_n) or page.run("return knead.frames") > frames, 2)
    for _ in range(30):
        time.sleep(0.05)
        forces.append(bus.force_n), states.append(page.now())
    page.release()
    back = until(lambda: page.run("return scene !== null && scene.ready()"))
    # The page reports a press that a watchdog has ended. A press that the page itself ends has no report.
    stalled = any(now["level"] == "fault" or "poses were late" in now["status"] for now in states)
    return drawn, min(forces) > 0, back, stalled, forces


def without_webgl(page, bus):
    for _ in range(4):
        drawn, pressed_on, back, stalled, forces = lose_webgl(page, bus)
        if pressed_on or not stalled:
            break
    check("WebGL is lost in a press: within 2 s the page shows pictures of knead web", drawn)
    check("the press goes on meanwhile", pressed_on, stalled, forces)
    check("after the press the page draws with WebGL again", back)


def touches(page, kind, *points):
    points = [{"x": page.place(*at)[0], "y": page.place(*at)[1], "id": i} for i, at in enumerate(points)]
    page.devtools("Input.dispatchTouchEvent", type="touch" + kind, touchPoints=points)


def by_two_fingers(page, bus):  # turn and zoom the view
    touches(page, "Start", (0.4, 0.5))
    touches(page, "Start", (0.4, 0.5), (0.6, 0.5))
    for i in range(5):
        touches(page, "Move", (0.4 - 0.02 * i, 0.5), (0.6 - 0.01 * i, 0.5))
    touches(page, "End")
    check("two fingers turn and zoom the view", page.run("return orbit.azimuth > 31 && orbit.zoom > 1.1"), page.run("return orbit"))
    check("two fingers press nothing", page.now()["force_n"] == 0, page.now())
    page.run("look(28, 27, 1, [0, 0])")


def by_grip(page, bus):  # in a scene with two round tools, two fingers lift the object
    choose(page, "scene", "pinch.yaml")
    until(lambda: page.text("names").startswith("pinch.yaml") and page.run("return about.second"), 20)
    at = lambda x, z: tuple(page.run("return seenAt(camera(), [arguments[0], 0, arguments[1]])", x, z))
    until(lambda: page.now()["status"].startswith("ready"), 20)
    page.run("look(0, 80, 1, [0, 0])")
    touches(page, "Start", (0.4, 0.5))
    touches(page, "Start", (0.4, 0.5), (0.6, 0.5))
    check("a grip from above is refused, with the reason", until(lambda: "a side" in page.now()["status"]), page.now()["status"])
    touches(page, "End")
    page.run("look(0, 12, 1, [0, 0])")
    heights = lambda: (min(bus.now), max(bus.now))

    def lift():
        touches(page, "Start", at(-0.03, 0.015))
        touches(page, "Start", at(-0.03, 0.015), at(0.03, 0.015))
        if not until(lambda: "together" in page.now()["status"], 15):
            return False
        for i in range(30):
            touches(page, "Move", at(-0.03 + 0.013 * i / 29, 0.015), at(0.03 - 0.013 * i / 29, 0.015))
            time.sleep(0.05)
        time.sleep(0.3)
        for i in range(40):
            touches(page, "Move", at(-0.017, 0.015 + 0.03 * i / 39), at(0.017, 0.015 + 0.03 * i / 39))
            time.sleep(0.05)
        return until(lambda: heights()[0] > 0.015, 4)
    for _ in range(4):
        missed = bus.missed
        if lifted := lift():
            break
        if bus.missed == missed:  # only a machine that stands still may spoil a grip
            break
        touches(page, "End")
        until(lambda: ready(page))
    check("two fingers grip the dough and lift it off the table", lifted, heights(), page.run("return poses"), page.now()["status"])
    page.screenshot(ARTEFACTS + "/web-pinch.png")
    touches(page, "End")
    check("when the fingers leave, the dough lies on the table again",
          lifted and until(lambda: heights()[0] < 0.001 and heights()[1] < 0.04), heights())
    choose(page, "scene", "dough-small.yaml")
    until(lambda: page.text("names").startswith("dough-small.yaml"), 20)
    page.run("look(28, 27, 1, [0, 0])")
    until(lambda: ready(page), 20)


def by_clip(page):
    click(page, "save-clip")
    check("a film of the last 10 s is saved", until(lambda: os.path.exists("saved/dough-small.webm"), 40), page.text("said"))
    probe = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-select_streams", "v", "-show_entries",
                            "stream=width,height,nb_read_frames", "-of", "csv=p=0", "saved/dough-small.webm"],
                           capture_output=True, text=True).stdout.strip().split(",")
    check("the film has 1280 x 720 pixels and shows motion", probe[:2] == ["1280", "720"] and int(probe[2]) > 30, probe)


def by_finger(page, bus):
    x, y = page.place(*TOP)
    touch = lambda kind, *points: page.devtools("Input.dispatchTouchEvent", type=kind, touchPoints=points)
    pressed(page, bus, "finger", lambda: touch("touchStart", {"x": x, "y": y}), lambda: touch("touchEnd"))


def ctl(*words):
    return json.loads(subprocess.run(["knead", "ctl", "--control", "control", "--json", *words],
                                     capture_output=True, text=True).stdout or "{}")


def click(page, id):
    page.run("document.getElementById(arguments[0]).click()", id)


def said(page, words):  # wait for the answer to the last order
    return until(lambda: words in page.text("said"))


def ready(page):
    page.hover(*TOP)
    return page.now()["status"].startswith("ready")


def dent(page, bus):  # press from the page; return the depth that remains
    page.hover(*TOP)
    until(lambda: page.now()["status"].startswith("ready"))
    begun(page, lambda: page.press(*TOP), page.release)
    until(lambda: page.now()["depth_mm"] > 4.7)
    page.release()
    until(lambda: page.now()["force_n"] == 0 and not page.now()["contact"])
    time.sleep(0.7)
    return bus.dent_mm()


def by_traces(page):
    page.run("document.getElementById('touch-box').open = true")
    ready(page)
    until(lambda: page.now()["status"].startswith("ready"))
    begun(page, lambda: page.press(*TOP), page.release)
    check("the page describes the contact of the tool", until(lambda: "kPa at most" in page.text("touch-words")),
          page.text("touch-words"))
    until(lambda: page.now()["depth_mm"] > 4.7)
    page.release()
    until(lambda: not page.now()["contact"])
    time.sleep(2)
    most = page.run("""const of = (name) => Math.max(...TRACES[name].ring.filter(Number.isFinite));
        return Object.fromEntries(Object.keys(TRACES).map((name) => [name, of(name)]))""")
    check("the traces show force, depth, work and energies of the press",
          most["force"] > 0.5 and most["depth"] > 4 and most["work"] > 0.5 and most["dissipated"] > 0.5
          and most["stored"] > 0.01, most)
    middle = page.run("""const all = [...TRACES.trip.ring].filter(Number.isFinite).sort((a, b) => a - b);
        return all[Math.floor(all.length / 2)]""")
    check("a trace shows the round trip in the device's own time", 0.05 < middle < 20, middle)
    for name in "depth", "work", "stored", "dissipated", "trip", "force":
        choose(page, "what", name)
    check("each trace can be chosen and has a name", page.run("return trace.ariaLabel").startswith("Force"),
          page.run("return trace.ariaLabel"))
    page.run("document.getElementById('touch-box').open = false")


def by_operator(page, bus):
    reset(page, bus, lambda: click(page, "reset"))  # an undo takes back only the last press
    deep = dent(page, bus)
    click(page, "undo")
    check("undo: the dent is gone", said(page, "undone") and until(lambda: bus.dent_mm() < deep / 4), deep,
          bus.dent_mm(), page.text("said"))
    deep = dent(page, bus)
    click(page, "snapshot")
    check("snapshot: the page reports the snapshot on disk", said(page, "saved"), page.text("said"))
    click(page, "reset")
    check("reset: the object is untouched", said(page, "reset") and until(lambda: bus.dent_mm() < 0.01), page.text("said"))
    time.sleep(1.2)  # time for kneadd to save the reset too
    click(page, "restore")
    check("restore: the dent is back", said(page, "restored") and until(lambda: bus.dent_mm() > 0.7 * deep), deep,
          bus.dent_mm(), page.text("said"))
    page.hover(*TOP)
    until(lambda: page.now()["status"].startswith("ready"))
    begun(page, lambda: page.press(*TOP), page.release)
    click(page, "estop")
    check("emergency stop in a press: the force is zero and the page says so",
          said(page, "Stopped") and until(lambda: bus.force_n == 0), bus.force_n, page.text("said"))
    check("after an emergency stop the page offers recover", until(lambda: page.run("return !recover.hidden && estop.hidden")))
    page.release()
    click(page, "recover")
    check("recover: the object can be pressed again",
          said(page, "Recovered") and until(lambda: ready(page), 15), page.text("said"), page.now()["status"])
    click(page, "reset")
    said(page, "reset")


def choose(page, id, name):
    page.run("""const s = document.getElementById(arguments[0]);
        s.value = arguments[1]; s.dispatchEvent(new Event('change'));""", id, name)


def save_here(page):  # of each window
    page.devtools("Browser.setDownloadBehavior", behavior="allow", downloadPath=os.getcwd() + "/saved")


def by_colours(page, bus):
    save_here(page)
    dent(page, bus)
    page.keep("material")
    for name, unit in ("displacement", " mm"), ("stress", "Pa"), ("residual", " %"):
        choose(page, "measure", name)
        check(f"colours of {name} change the picture and show a scale",
              until(lambda: (page.keep(name), page.changed("material", name) > 5000)[1])
              and until(lambda: page.text("legend-top").endswith(unit)), page.text("said"), page.text("legend-top"))
        time.sleep(0.3)
        page.screenshot(f"{ARTEFACTS}/web-{name}.png")
    click(page, "save-picture")
    check("the whole picture is saved", until(lambda: os.path.exists("saved/dough-small.png")), page.text("said"))
    png = open("saved/dough-small.png", "rb").read()
    check("the saved picture is a PNG with all pixels of the page's",
          png[:8] == b"\x89PNG\r\n\x1a\n" and list(struct.unpack(">II", png[16:24])) == page.run("return [canvas.width, canvas.height]"), png[:30])
    open(f"{ARTEFACTS}/web-saved.png", "wb").write(png)
    choose(page, "measure", "none")
    check("without colours the legend is hidden", until(lambda: page.run("return document.getElementById('legend').hidden")))
    click(page, "closer")
    check("zooming in enlarges the object",
          until(lambda: (page.keep("closer"), page.changed("material", "closer") > 20000)[1]))
    page.hover(*TOP)
    page.press(*TOP)
    check("in the zoomed picture the tool presses where it points", until(lambda: page.now()["contact"] and page.now()["force_n"] > 0.3), page.now())
    page.release()
    click(page, "farther")
    click(page, "reset")


def asks(page, what, **fields):  # return {"ok", "words"}
    return page.driver.execute_async_script("ask(arguments[0], arguments[1]).then(arguments[2])", what, fields)


def by_recordings(page, bus):
    take = lambda: (page.run("return about.recordings") or [{}])[0]
    dent(page, bus)  # so that it begins on a kneaded object
    click(page, "record")
    check("recording: it runs within 8 s", until(lambda: take().get("state") == "runs"), take(), page.text("said"))
    deep = dent(page, bus)
    click(page, "record")
    check("recording: a stopped recording is complete", until(lambda: take()["state"] == "whole"), take())
    check("recording: its length and size are shown", 1 < take()["s"] < 30 and take()["mb"] > 0.3, take())
    row = lambda name: page.run("""[...document.querySelectorAll('#recordings button')]
        .find((b) => b.textContent === arguments[0]).click()""", name)
    row("Log")
    log = "saved/dough-small-1.lcmlog"
    check("recording: its log is saved", until(lambda: os.path.exists(log)), page.text("said"))
    told = subprocess.run(["knead", "replay", log, "--verify"], capture_output=True, text=True)
    check("recording: its log holds its object, and verifies", told.returncode == 0 and "verified" in told.stdout and "continued from" in told.stdout,
          told.stdout, told.stderr)
    row("CSV")
    check("recording: its forces are saved as CSV", until(lambda: os.path.exists("saved/dough-small-1.csv"), 30), page.text("said"))
    rows = open("saved/dough-small-1.csv").read().splitlines()
    check("recording: the CSV has a row for each force", rows[0].startswith("tick,time_s,probe,x_m") and len(rows) > 1000, rows[0], len(rows))
    check("recording: the number of verified forces is shown", until(lambda: f"verified {len(rows) - 1} forces" in take()["words"]),
          take(), len(rows))
    click(page, "reset")
    until(lambda: bus.dent_mm() < 0.01)
    answer = asks(page, "play", value=1)
    check("play: the recorded hand presses the present object",
          answer["ok"] and bus.dent_mm() > 0.3 * deep, answer, bus.dent_mm(), deep)
    check("play: the page gets the tool back afterwards", until(lambda: ready(page)), page.now()["status"])
    answer = asks(page, "verify", value=7)
    check("play of an unknown recording is refused", not answer["ok"] and "no such" in answer["words"], answer)
    check("a stop without a recording is refused", "not running" in asks(page, "stop", value=1)["words"])
    click(page, "reset")


def by_slider(page):  # drag away and back by mouse: nothing changes, and the slider follows kneadd again
    page.run("document.getElementById('m-k1').scrollIntoView({ block: 'center' })")
    x, y, share = page.run("""const i = document.getElementById('m-k1'), b = i.getBoundingClientRect();
        return [b.x, b.y + b.height / 2, [(i.value - i.min) / (i.max - i.min), b.width]]""")
    at = x + 8 + share[0] * (share[1] - 16)
    page.mouse("Moved", at, y, held=0)
    page.mouse("Pressed", at, y)
    value = page.run("return document.getElementById('m-k1').value")
    drag = lambda x: page.devtools("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="left", buttons=1)
    drag(at + 40)
    away = page.run("return document.getElementById('m-k1').value")
    drag(at)
    page.mouse("Released", at, y, held=0)
    back = page.run("return document.getElementById('m-k1').value")
    check("a slider can be dragged away and back", away != value == back, value, away, back)
    wanted = page.run("return about.material.k1")
    told = ctl("set", f"material.k1={wanted / 1.5:.6g} Pa")
    check("the slider follows a new value of kneadd", until(lambda: page.run("return document.getElementById('m-k1').value") != value), value, told)
    ctl("set", f"material.k1={wanted:.6g} Pa")
    check("the slider follows kneadd back", until(lambda: page.run("return document.getElementById('m-k1').value") == value), value)
    page.run("picture.focus()")
    page.key("Down", "Escape"), page.key("Up", "Escape")  # keys again: from here on the focus is visible


def by_material(page):
    page.run("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    before = page.run("return about.material.k1")
    page.run("""const s = document.getElementById('m-k1');
        s.value = 30; s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change'));""")
    check("a slider sets the material", said(page, "Changed"), page.text("said"))
    wanted = before * 10 ** 0.3
    check("kneadd's spring is what the slider says", any(abs(float(s.split("=")[1].split()[0]) / wanted - 1) < 1e-3
                                                         for s in ctl("status")["set"] if s.startswith("material.k1=")),
          ctl("status").get("set"), wanted)
    check("the page shows the new spring", until(lambda: abs(page.run("return about.material.k1") / wanted - 1) < 1e-3))
    for id, name in ("save-material", "dough-small-material.yaml"), ("save-scene", "dough-small-served.yaml"):
        click(page, id)
        check(f"{name} is saved", until(lambda: os.path.exists("saved/" + name)), os.listdir("."))
    scene = f"{os.environ['KN_SOURCE']}/core/scenes/dough.yaml"
    for words in [scene, "--set", "material=saved/dough-small-material.yaml"], ["saved/dough-small-served.yaml"]:
        told = subprocess.run(["knead", "check", *words, "--text"], capture_output=True, text=True)
        k1 = next((float(line.split()[1]) for line in told.stdout.splitlines() if line.startswith("  k1:")), 0)
        check("the saved scene loads with the new spring", abs(k1 / wanted - 1) < 1e-3, told.stderr, k1, wanted)
    by_slider(page)
    choose(page, "material", "liver")
    check("a material that cannot continue the object is refused in kneadd's words",
          said(page, "a damper where there was none"), page.text("said"))
    choose(page, "material", "dough")
    check("a material that can continue the object is accepted", said(page, "Changed") and
          until(lambda: abs(page.run("return about.material.k1") / before - 1) < 1e-3), page.text("said"), before)
    choose(page, "scene", "dough.yaml")
    check("another scene is served and shown", until(lambda: page.text("names").startswith("dough.yaml"), 20),
          page.text("names"), page.text("said"))
    until(lambda: "quality" in ctl("status"))
    choose(page, "quality", "fast")
    check("quality fast is in force", until(lambda: ctl("status")["quality"]["in_force"] == "fast"), ctl("status")["quality"])
    check("the page shows the quality", until(lambda: page.run("return document.getElementById('quality').value") == "fast"))
    choose(page, "scene", "dough-small.yaml")
    check("the first scene is served and shown again", until(lambda: page.text("names").startswith("dough-small.yaml"), 20), page.text("names"))
    check("the tool is ready again",
          until(lambda: ready(page), 20), page.now()["status"])


def by_view(page, bus):
    page.keep("corner")
    click_view = lambda name: page.run("""[...document.querySelectorAll('[data-view]')]
        .find((b) => b.textContent === arguments[0]).click()""", name)
    click_view("Top")
    check("the view from above is another picture", until(lambda: (page.keep("top"), page.changed("corner", "top") > 20000)[1]))
    before = bus.dent_mm()
    above = page.top()
    page.hover(*above)
    time.sleep(1)
    page.press(*above)
    check("from above the tool presses where the pointer is",
          until(lambda: page.now()["force_n"] > 0.5 and bus.dent_mm() > before + 1), page.now(), bus.dent_mm())
    page.release()
    click_view("Corner")
    page.mouse("Pressed", *page.place(0.5, 0.5), button="right", held=2)
    for _ in range(5):
        page.mouse("Moved", page.x + 20, page.y, held=2)
    page.mouse("Released", page.x, page.y, button="right", held=0)
    check("the right button turns the view", until(lambda: abs(page.run("return orbit.azimuth") + 12) < 1),
          page.run("return orbit"))
    page.run("document.getElementById('picture').focus()")
    page.devtools("Input.dispatchKeyEvent", type="keyDown", key="ArrowLeft", code="ArrowLeft", modifiers=8)
    check("Shift and an arrow turn the view", until(lambda: abs(page.run("return orbit.azimuth") + 6) < 1),
          page.run("return orbit"))
    click_view("Corner")
    until(lambda: page.run("return orbit.azimuth") == 28)
    click(page, "reset")


def looks(page):
    page.run("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    page.run("window.scrollTo(0, 0)")
    for scheme in "light", "dark":
        page.devtools("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        least = page.run(CONTRAST)[0]
        check(f"{scheme}: every text has a contrast of at least 4.5", least[0] >= 4.5, least)
    for width in 360, 640, 1600: # 640: 1280 at 200 % zoom
        page.devtools("Emulation.setDeviceMetricsOverride", width=width, height=800, deviceScaleFactor=1,
                      mobile=width < 500)
        for scheme in "light", "dark":
            page.devtools("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            time.sleep(0.3)
            page.screenshot(f"{ARTEFACTS}/web-{scheme}-{width}.png")
        wide = page.run("return document.documentElement.scrollWidth")
        check(f"{width} px: the page is not wider than the window", wide <= width, wide)
    page.devtools("Emulation.clearDeviceMetricsOverride")
    unnamed = page.run("""return [...document.querySelectorAll('input, button, select, canvas:not([aria-hidden])')]
        .filter((e) => !e.labels?.[0] && !(e.localName === 'button' && e.textContent) && !e.ariaLabel)
        .map((e) => e.id)""")
    check("every control and picture has a name", unnamed == [], unnamed)


def by_tab(page):  # follow the focus by tab, and check that it is visible
    page.run("document.querySelectorAll('details').forEach((d) => { d.open = false; })")
    page.run("window.scrollTo(0, 0); picture.focus()")
    came = []
    while len(came) < 40:
        at = page.run("""const e = document.activeElement, s = getComputedStyle(e), b = e.getBoundingClientRect();
            return [e.id || e.textContent.trim(), s.outlineStyle !== 'none' && parseFloat(s.outlineWidth) >= 2,
                    b.bottom > 0 && b.top < innerHeight]""")
        if page.run("return document.activeElement === document.body"):
            break  # at the end
        came.append(at)
        page.key("Down", "Tab", "Tab")
        page.key("Up", "Tab", "Tab")
    names = [name for name, _, _ in came]
    wanted = ["picture", "Corner", "Front", "Side", "Top", "closer", "farther", "measure", "save-clip", "depth", "undo", "reset"]
    check("Tab visits the controls in order", names[:len(wanted)] == wanted, names)
    check("Tab reaches the emergency stop, and every box",
          {"estop", "Trace", "Material", "Recordings", "Numbers"} <= set(names), names)
    check("the focus is visible everywhere", all(seen and inside for _, seen, inside in came),
          [name for name, seen, inside in came if not (seen and inside)])


def without_control(server, page):
    server.start("bare", ["knead", "web"], "http://")
    page.driver.switch_to.new_window("window")
    page.open(opened("bare.log")[0])
    disabled = lambda: page.run("return ['undo', 'reset', 'snapshot', 'restore', 'estop'].every((id) => $(id).disabled)")
    check("without --control every operator's button is disabled", until(disabled))
    check("without --control the page gives the reason", "without --control" in page.text("why"), page.text("why"))
    check("without --control the picture is drawn", until(lambda: page.run("return knead.frames > 5")))
    page.driver.close()
    page.driver.switch_to.window(page.driver.window_handles[0])
    server.last.terminate()
    server.last.wait(10)


def two_tabs(page, bus, address):
    driver, first = page.driver, page.driver.current_window_handle
    page.hover(*TOP)
    driver.switch_to.new_window("window")
    page.open(address)
    second = driver.current_window_handle
    driver.switch_to.window(first)  # after 2 s without a touch, the tool would be free for anybody
    page.hover(*TOP)
    driver.switch_to.window(second)
    check("a second page reports that another page holds the tool",
          until(lambda: "another page" in page.text("words")), page.text("words"))
    check("the second page shows the level Waiting", page.text("level") == "Waiting", page.text("level"))
    driver.close()
    driver.switch_to.window(first)

    driver.switch_to.new_window("window")
    page.open(address)
    until(lambda: (page.hover(*TOP), page.now()["mine"])[1])
    time.sleep(0.5)
    before = bus.dent_mm()
    page.press(*TOP)
    check("the second page presses once the first is idle",
          until(lambda: bus.force_n > 0.5 and bus.dent_mm() > before + 1), bus.force_n, page.now())
    driver.close()
    check("closing the page during a press takes the force to zero", until(lambda: bus.force_n == 0), bus.force_n)
    time.sleep(1)
    check("the dent stays after the page is closed", bus.dent_mm() > before + 0.5, before, bus.dent_mm())
    driver.switch_to.window(first)


def goodbye(page, server):
    server.kneadd.terminate()
    check("when kneadd has ended the page says what it waits for",
          until(lambda: "waiting for kneadd" in page.text("words")), page.text("words"))
    server.web.terminate()
    check("when knead web has ended the page says so",
          until(lambda: "knead web has ended" in page.text("words")), page.text("words"))
    codes = server.web.wait(10), server.kneadd.wait(10)
    check("kneadd and knead web exit with 0", codes == (0, 0), codes)
    without_web(page, server)


ORDERS = "#controls button, #more button, #more select:not(#what), #sliders input, #view button, #view select"


def complaints(page):  # ignore connections refused while no server runs
    refused = "WebSocket connection to", "net::ERR_CONNECTION_REFUSED"
    return [line for line in page.complaints() if not any(words in line["message"] for words in refused)]


def without_web(page, server):
    able = page.run(f"return [...document.querySelectorAll('{ORDERS}')].filter((e) => !e.disabled).map((e) => e.id)")
    check("without knead web every control is disabled", able == [], able)
    bare = page.run(f"""return [...document.querySelectorAll('{ORDERS}')].filter((e) => {{
        const ids = (e.getAttribute('aria-describedby') ?? e.parentElement.getAttribute('aria-describedby')
            ?? e.closest('[role=group]')?.getAttribute('aria-describedby') ?? '').split(' ');
        return !ids.some((id) => document.getElementById(id)?.textContent);
    }}).map((e) => e.id || e.textContent)""")
    check("each disabled control gives the reason", bare == [], bare)
    page.run(f"""for (const e of document.querySelectorAll('{ORDERS}')) {{ // what was on its way
        for (const kind of ['input', 'change', 'pointerup']) e.dispatchEvent(new Event(kind));
        e.disabled = false;
        e.click();
    }}""")
    for key in "r", "u", "+", " ", "Escape":
        page.run("document.getElementById('picture').focus()")
        page.key("Down", key), page.key("Up", key)
    page.press(*TOP)
    page.release()
    time.sleep(0.5)
    check("using a disabled control causes no error in the console", not (log := complaints(page)), log)
    server.start("web", ["knead", "web", "--port", str(server.port)], "http://")
    check("after a restart on the same port the page reports its old token",
          until(lambda: "token" in page.text("words")), page.text("words"))
    page.driver.get(opened("web.log")[0])
    check("the new address opens the page", until(lambda: "waiting for kneadd" in page.text("words")), page.text("words"))
    enabled = lambda: not page.run("return document.getElementById('closer').disabled")
    check("the page's own controls are enabled again", until(enabled))
    subprocess.run(["ip", "addr", "add", "192.0.2.5/32", "dev", "lo"], check=True)
    server.start("lan", ["knead", "web", "--address", "192.0.2.5"], "https://")
    page.driver.get(opened("lan.log")[0])  # this page has no picture to wait for
    check("the page opens encrypted at another address", until(lambda: "waiting for kneadd" in page.text("words")),
          page.text("words"))
    check("the console has no other messages", not (log := complaints(page)), log)
    server.last.terminate()
    server.last.wait(10)


def main():
    pictures = sys.argv[1:] == ["picture"]  # as in a browser without WebGL
    server, bus, page = Served("dough-small.yaml"), Bus(), Browser()
    address = server.address.replace("/#", "/?draw=picture#") if pictures else server.address
    check("the page opens and draws", page.open(address), page.text("status"))
    TOP[:] = page.top()
    check("the page shows pictures of knead web" if pictures else "the page draws with WebGL",
          page.run("return scene === null && canvas.width === 800" if pictures else "return scene !== null"))
    check("the page names the scene and the tool", page.text("names") == "dough-small.yaml · finger", page.text("names"))
    by_mouse(page, bus)
    if not pictures:
        without_webgl(page, bus)
    if NIGHT:
        by_keys(page, bus)
        by_finger(page, bus)
        by_traces(page)
        by_operator(page, bus)
        by_view(page, bus)
        by_colours(page, bus)
        by_clip(page)
        by_two_fingers(page, bus)
        by_grip(page, bus)
        by_recordings(page, bus)
        by_material(page)
        looks(page)
        by_tab(page)
        without_control(server, page)
        two_tabs(page, bus, address)
    check("the console has no messages", not (log := page.complaints()), log)
    goodbye(page, server)
    page.driver.quit()
    sys.exit(results.failed)


if __name__ == "__main__":
    main()
