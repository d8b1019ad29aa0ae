#!/usr/bin/python3
# Pointer event to drawn frame, in headless Chromium on a live page: the time from the page's handler of a pointer
# event to the first drawn frame with its effect (not to photons). Every event of the run counts.
#
#     cmake --preset release && cmake --build --preset release -j
#     PATH=$PWD/build/release/bin:$PATH KN_SOURCE=$PWD tests/netns bench/web.py [OPTION]...
import argparse
import math
import os
import platform
import random
import sys
import time
sys.path.insert(0, os.environ["KN_SOURCE"] + "/tests/e2e")
from served import Browser, Bus, Served, cpu_s, until
from web_wire import Page


def children(pid):
    return [int(child) for thread in os.listdir(f"/proc/{pid}/task")
            for child in open(f"/proc/{pid}/task/{thread}/children").read().split()]


def family_cpu_s(pid):
    return cpu_s(pid) + sum(family_cpu_s(child) for child in children(pid))


def browser_cpu_s(page):  # processor time of all processes of the browser, without chromedriver
    return sum(family_cpu_s(pid) for pid in children(page.driver.service.process.pid))


def machine_cpu_s():  # busy and stolen time: unavailable to others
    user, nice, system, _, _, irq, softirq, steal = map(int, open("/proc/stat").readline().split()[1:9])
    return (user + nice + system + irq + softirq + steal) / os.sysconf("SC_CLK_TCK")


def percentile(sorted_ms, share):
    return sorted_ms[min(len(sorted_ms) - 1, math.ceil(share * len(sorted_ms)) - 1)] if sorted_ms else math.nan


def play(page, seconds, press):  # an event every 25 to 45 ms: a circle over the block, or a to-and-fro stroke in a press
    pace, end, i = random.Random(1), time.monotonic() + seconds, 0
    x, y = page.place(0.5, 0.42)
    while (now := time.monotonic()) < end:
        phase = 2 * math.pi * i / 90
        if press:
            page.mouse("Moved", x, y + 20 * math.sin(phase))
        else:
            page.mouse("Moved", x + 60 * math.cos(phase), y + 25 * math.sin(phase), held=0)
        i += 1
        time.sleep(max(0, now + pace.uniform(0.025, 0.045) - time.monotonic()))


# ticks, missed ticks, and missed ticks that no stall of the machine explains, all since `before`
def missed(bus, before=(0, 0, 0)):
    return tuple(a - b for a, b in zip((bus.tick, bus.missed, bus.unexplained), before))


def rate(counts):  # as two columns of the table: missed and unexplained ticks per million
    return f"{1e6 * counts[1] / max(1, counts[0]):6.0f} | {1e6 * counts[2] / max(1, counts[0]):11.0f} |"


def alone(server, bus, seconds):  # without a page, for comparison: a status comes every second
    until(lambda: bus.tick)
    before, cpu, begin = missed(bus), [server.cpu_s(), cpu_s(server.kneadd.pid), machine_cpu_s()], time.monotonic()
    time.sleep(seconds)
    after, elapsed = [server.cpu_s(), cpu_s(server.kneadd.pid), machine_cpu_s()], time.monotonic() - begin
    web, kneadd, all_ = [(b - a) / elapsed * 100 for a, b in zip(cpu, after)]
    print(f"| no page |        |       |        |        |        | {web:9.0f} |         | {kneadd:6.0f} | "
          f"{max(0, all_ - web - kneadd):4.0f} | {rate(missed(bus, before))}", flush=True)


def measure(name, page, server, bus, seconds, press):
    page.hover(0.5, 0.42)
    until(lambda: page.now()["status"].startswith("ready"))
    if press:
        page.mouse("Pressed", page.x, page.y)
        until(lambda: page.now()["contact"])
    page.run("knead.latency.length = 0")
    events, frames = page.run("return [knead.events, knead.frames]")
    shares = lambda: [server.cpu_s(), browser_cpu_s(page), cpu_s(server.kneadd.pid), machine_cpu_s()]
    begin, before, ticks = time.monotonic(), shares(), missed(bus)
    play(page, seconds, press)
    elapsed = time.monotonic() - begin
    cpu = [(after - before) / elapsed * 100 for after, before in zip(shares(), before)]
    latency, frames = sorted(page.run("return knead.latency")), page.run("return knead.frames") - frames
    page.release() if press else None
    p50, p95, p99 = (percentile(latency, share) for share in (0.5, 0.95, 0.99))
    print(f"| {name:7} | {len(latency):6} | {frames / elapsed:5.1f} | {p50:6.1f} | {p95:6.1f} | {p99:6.1f} | "
          f"{cpu[0]:9.0f} | {cpu[1]:7.0f} | {cpu[2]:6.0f} | {max(0, cpu[3] - sum(cpu[:3])):4.0f} | "
          f"{rate(missed(bus, ticks))}", flush=True)


def press(page, u, v, mm):  # to the depth of the slider, then deeper by mm with the wheel
    page.hover(u, v)
    until(lambda: page.now()["status"].startswith("ready"))
    time.sleep(0.5)
    page.press(u, v)
    until(lambda: page.now()["depth_mm"] > 4.7)
    page.wheel(mm)
    time.sleep(1)


def show(page, path):  # save a picture of a block that was pressed at one place before, and is now pressed at another
    page.devtools("Emulation.setDeviceMetricsOverride", width=1280, height=960, deviceScaleFactor=1, mobile=False)
    page.run("document.getElementById('material-box').open = true")
    press(page, 0.42, 0.42, 4)
    page.release()
    page.wheel(-4)
    press(page, 0.56, 0.38, 2)
    page.screenshot(path)
    page.release()


def crowd(server, bus, seconds, count):  # pages without a browser, of which one presses: in turns with none
    print("| viewers | messages/s each | web cpu % | memory kB |  ticks | missed | unexplained |\n"
          "|--------:|----------------:|----------:|----------:|-------:|-------:|------------:|")
    for viewers in (0, count) * 3:
        pages = [Page(server, presses=i == 0) for i in range(viewers)]
        time.sleep(6)  # kneadd says its counts every second; the tool of the row before lifts
        before, frames, cpu, begin = missed(bus), [page.frames for page in pages], server.cpu_s(), time.monotonic()
        time.sleep(seconds)
        elapsed = time.monotonic() - begin
        each = sum(page.frames - was for page, was in zip(pages, frames)) / elapsed / max(1, viewers)
        ticks = missed(bus, before)
        print(f"| {viewers:7} | {each:15.1f} | {100 * (server.cpu_s() - cpu) / elapsed:9.1f} | {server.memory_kb():9} | "
              f"{ticks[0]:6} | {ticks[1]:6} | {ticks[2]:11} |", flush=True)
        for page in pages:
            page.stop()


def main():
    options = argparse.ArgumentParser()
    options.add_argument("--seconds", type=float, default=20, help="per row (20)")
    options.add_argument("--scene", default="dough-diagonals.yaml", help="of core/scenes (dough-diagonals.yaml)")
    options.add_argument("--draw", choices=["mesh", "picture"], default="mesh",
                         help="who draws: mesh: the browser, by WebGL; picture: knead web (mesh)")
    options.add_argument("--size", default="800x450", help="of the drawing by the browser (800x450)")
    options.add_argument("--viewers", type=int, help="measure only what this number of pages without a browser costs")
    options.add_argument("--picture", metavar="/FILE", help="measure nothing: the page in a press, as PNG")
    o = options.parse_args()
    if o.picture and not os.path.isabs(o.picture):
        options.error(f"--picture {o.picture}: expected a path from /: tests/netns runs this in a folder of its own")
    os.environ.setdefault("KN_REALTIME", "auto")
    model = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo") if line.startswith("model name")), "?")
    print(f"machine   {model}, {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}, {platform.release()}")
    server, bus = Served(o.scene), Bus()
    address = server.address.replace("/#", f"/?draw={'fine' if o.picture else o.draw}#")
    if o.viewers is not None:
        until(lambda: bus.tick)
        crowd(server, bus, o.seconds, o.viewers)
        return server.stop()
    head = ("| pointer | events |   fps | p50 ms | p95 ms | p99 ms | web cpu % | browser | kneadd | rest | missed | "
            "unexplained |\n|---------|-------:|------:|-------:|-------:|-------:|----------:|--------:|-------:|-----:|"
            "-------:|------------:|")
    page = Browser()
    # The picture has two thirds of the window.
    width, height = map(int, o.size.split("x"))
    page.devtools("Emulation.setDeviceMetricsOverride", width=width * 3 // 2, height=height, deviceScaleFactor=1, mobile=False)
    if not page.open(address):
        sys.exit("bench/web.py: the page draws nothing: " + page.text("status"))
    if o.picture:
        show(page, o.picture)
        page.driver.quit()
        return server.stop()
    print(f"browser   Chromium {page.driver.capabilities['browserVersion']}, headless, drawing in software\n"
          f"scene     {o.scene}, drawn by {'the browser' if o.draw == 'mesh' else 'knead web'}, {o.size}\n")
    paint_ms = page.run("return performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? NaN")
    first_ms = page.run("return knead.first_ms")
    print(f"first paint {paint_ms:.0f} ms after the address was opened, the object drawn after {first_ms:.0f}\n\n{head}")
    page.driver.get("about:blank")
    alone(server, bus, o.seconds)
    page.open(address)
    measure("hovers", page, server, bus, o.seconds, press=False)
    measure("presses", page, server, bus, o.seconds, press=True)
    print("\nmissed: ticks of a million that were not run; unexplained: those for which the machine did not stand still")
    page.driver.quit()
    server.stop()


main()
