# The live page, as who visits it has it. Driven by test_web.sh.
import os
import sys
import time
from served import Browser, Bus, Served, check, until
import served as results

TOP = (0.5, 0.4)  # of the picture: on the top of the block

# What must be legible against what it is on (WCAG 2.1 AA), for whatever is shown.
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


def pressed(page, bus, sentence, begin, end):  # begins a press, watches it, ends it
    bus_before = bus.dent_mm()
    begin()
    check(f"{sentence}: the force rises", until(lambda: page.now()["force_n"] > 0.5), page.now())
    check(f"{sentence}: the tool is as deep as the slider says", until(lambda: abs(page.now()["depth_mm"] - 5) < 0.3),
          page.text("depth-now"), page.now())
    check(f"{sentence}: the page says so in words",
          until(lambda: page.text("contact") == "touching" and page.text("level") == "Live"),
          page.text("contact"), page.text("status"))
    end()
    check(f"{sentence}: let go, the force is zero",
          until(lambda: page.now()["force_n"] == 0 and not page.now()["contact"]), page.now())
    check(f"{sentence}: the dent stays", until(lambda: bus.dent_mm() > bus_before + 0.5), bus_before, bus.dent_mm())


def reset(page, bus, how):
    generation = bus.generation
    how()
    check("reset: the object is as new", until(lambda: bus.generation != generation and bus.dent_mm() < 0.01),
          generation, bus.generation, bus.dent_mm())
    check("and may be pressed again", until(lambda: page.now()["status"].startswith("ready")), page.now())


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
    check("the dent is seen", dented > 1000, dented)

    page.press(*TOP)
    until(lambda: page.now()["depth_mm"] > 4.7)
    for i in range(6):
        page.mouse("Moved", page.x, page.y + 5)
    check("dragged down, it goes deeper", until(lambda: page.now()["depth_mm"] > 7.7), page.now())
    page.screenshot(os.environ.get("KN_ARTEFACTS", os.environ["KN_BUILD"] + "/tests") + "/web.png")
    page.devtools("Input.dispatchMouseEvent", type="mouseWheel", x=page.x, y=page.y, deltaX=0, deltaY=200, buttons=1)
    check("so it does by the wheel", until(lambda: page.now()["depth_mm"] > 8.7), page.now())
    page.mouse("Moved", 2, 2)  # out of the picture
    page.mouse("Released", 2, 2, held=0)
    check("let go outside of the picture, it lets go", until(lambda: page.now()["force_n"] == 0), page.now())
    check("the drag is forgotten, the wheel is not", page.text("depth-now") == "6.0 mm", page.text("depth-now"))

    reset(page, bus, lambda: page.run("document.getElementById('reset').click()"))
    page.hover(*TOP)

    def as_before():  # once the tool is back and drawn
        page.keep("reset")
        return page.changed("new", "reset") < dented / 20
    check("the picture is as before", until(as_before), dented, page.changed("new", "reset"))


def by_keys(page, bus):
    page.run("document.getElementById('picture').focus()")
    before = page.text("depth-now")
    for _ in range(2):
        page.key("Down", "-", "Minus", "-"), page.key("Up", "-", "Minus")
    after = page.text("depth-now")
    check("minus makes it less deep", before == "6.0 mm" and after == "5.0 mm", before, after)
    for _ in range(3):
        page.key("Down", "ArrowLeft"), page.key("Up", "ArrowLeft")
        time.sleep(0.05)
    time.sleep(0.5)
    pressed(page, bus, "space", lambda: page.key("Down", " ", "Space", " "), lambda: page.key("Up", " ", "Space"))
    page.key("Down", "Enter", "Enter", "\r")
    until(lambda: page.now()["depth_mm"] > 4)
    page.key("Down", "Escape")
    check("Escape lets go", until(lambda: page.now()["force_n"] == 0), page.now())
    page.key("Up", "Enter")
    page.key("Down", " ", "Space", " ")
    until(lambda: page.now()["force_n"] > 0.1)
    page.run("document.getElementById('depth').focus()")
    check("so does leaving the picture by Tab", until(lambda: page.now()["force_n"] == 0), page.now())
    page.run("document.getElementById('picture').focus()")
    reset(page, bus, lambda: (page.key("Down", "r", "KeyR", "r"), page.key("Up", "r", "KeyR")))


def by_finger(page, bus):
    x, y = page.place(*TOP)
    touch = lambda kind, *points: page.devtools("Input.dispatchTouchEvent", type=kind, touchPoints=points)
    pressed(page, bus, "finger", lambda: touch("touchStart", {"x": x, "y": y}), lambda: touch("touchEnd"))


def looks(page):
    for scheme in "light", "dark":
        page.devtools("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        least = page.run(CONTRAST)[0]
        check(f"{scheme}: everything is legible", least[0] >= 4.5, least)
    for width in 360, 1600:
        page.devtools("Emulation.setDeviceMetricsOverride", width=width, height=800, deviceScaleFactor=1,
                      mobile=width < 500)
        wide = page.run("return document.documentElement.scrollWidth")
        check(f"{width} px: nothing is cut off", wide <= width, wide)
    page.devtools("Emulation.clearDeviceMetricsOverride")
    unnamed = page.run("""return [...document.querySelectorAll('input, button')]
        .filter((e) => !e.labels[0] && !e.textContent).length""")
    check("every control has a label", unnamed == 0, unnamed)


def two_tabs(page, bus, address):
    driver, first = page.driver, page.driver.current_window_handle
    page.hover(*TOP)
    driver.switch_to.new_window("window")
    page.open(address)
    check("a second page is told that another one holds the tool",
          until(lambda: "another page" in page.text("words")), page.text("words"))
    check("as something to wait for", page.text("level") == "Waiting", page.text("level"))
    driver.close()
    driver.switch_to.window(first)

    driver.switch_to.new_window("window")
    page.open(address)
    until(lambda: (page.hover(*TOP), page.now()["mine"])[1])
    time.sleep(0.5)
    before = bus.dent_mm()
    page.press(*TOP)
    check("it presses once the first is idle",
          until(lambda: bus.force_n > 0.5 and bus.dent_mm() > before + 1), bus.force_n, page.now())
    driver.close()
    check("closed in mid-press: the force goes to zero", until(lambda: bus.force_n == 0), bus.force_n)
    time.sleep(1)
    check("and the dent stays", bus.dent_mm() > before + 0.5, before, bus.dent_mm())
    driver.switch_to.window(first)


def goodbye(page, server):
    server.kneadd.terminate()
    check("kneadd ended: the page says what it waits for",
          until(lambda: "waiting for kneadd" in page.text("words")), page.text("words"))
    server.web.terminate()
    check("knead web ended: the page says so",
          until(lambda: "knead web has ended" in page.text("words")), page.text("words"))
    codes = server.web.wait(10), server.kneadd.wait(10)
    check("both ended with 0", codes == (0, 0), codes)


def main():
    server, bus, page = Served("dough-small.yaml"), Bus(), Browser()
    check("the page opens and draws", page.open(server.address), page.text("status"))
    check("it names scene and tool", page.text("names") == "dough-small.yaml · finger", page.text("names"))
    by_mouse(page, bus)
    by_keys(page, bus)
    by_finger(page, bus)
    looks(page)
    two_tabs(page, bus, server.address)
    check("a clean console", not (log := page.complaints()), log)
    goodbye(page, server)
    page.driver.quit()
    sys.exit(results.failed)


main()
