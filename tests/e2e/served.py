# kneadd and knead web for scripts: start them, listen to them on LCM, and open their page in Chromium (class
# Browser). Runs inside tests/netns, with the build's bin first in PATH, by /usr/bin/python3, whose modules come from
# Debian's packages.
import collections
import os
import socket
import struct
import subprocess
import sys
import threading
import time

failed = False


def check(sentence, holds, *seen):  # print one line as tests/check.h does
    global failed
    failed = failed or not holds
    print("ok   " + sentence if holds else f"FAIL {sentence}: {', '.join(map(str, seen))}", flush=True)
    return holds


def until(what, seconds=10):  # return what()'s first true answer, or its last false one
    end = time.monotonic() + seconds
    while not (got := what()) and time.monotonic() < end:
        time.sleep(0.02)
    return got


Address = collections.namedtuple("Address", "address port token")


def opened(log):  # read the address that knead web printed there
    address = next(word for word in open(log).read().split() if word.startswith("http"))
    return Address(address, int(address.split(":")[2].split("/")[0]), address.split("#")[1])


class Served:
    """kneadd on a scene of the source tree, and knead web beside it, joined by its control socket."""

    def __init__(self, scene, *options):
        os.makedirs("state", exist_ok=True)
        self.serve(scene, ["--control", "control", "--state-dir", "state", "--touch", "--set", "mesh.measures=both"])
        scenes = f"{os.environ['KN_SOURCE']}/core/scenes"
        self.web = self.start("web", ["knead", "web", "--control", "control", "--scenes", scenes, *options], "http://")
        self.address, self.port, self.token = opened("web.log")

    def serve(self, scene, options=()):
        kneadd = ["kneadd", f"{os.environ['KN_SOURCE']}/core/scenes/{scene}"]
        self.kneadd = self.start("kneadd", [*kneadd, "--realtime", os.environ["KN_REALTIME"], *options], "serving")

    def start(self, name, command, word):  # return once the program has printed the word
        log = open(f"{name}.log", "w")
        process = self.last = subprocess.Popen(command, stdout=log, stderr=log, stdin=subprocess.DEVNULL)
        said = lambda: open(f"{name}.log").read().strip()
        if not until(lambda: word in said() or process.poll() is not None) or process.poll() is not None:
            sys.exit(f"FAIL {name} did not come up: {said()}")
        return process

    def memory_kb(self):
        return int(next(line for line in open(f"/proc/{self.web.pid}/status") if line.startswith("VmRSS")).split()[1])

    def cpu_s(self):
        return cpu_s(self.web.pid)

    def stop(self):  # both must end with 0, knead web first
        for name, process in ("knead web", self.web), ("kneadd", self.kneadd):
            process.terminate()
            check(f"{name} ends with 0", process.wait(10) == 0, process.returncode)


def cpu_s(pid):  # user and system time of all its threads
    fields = open(f"/proc/{pid}/stat").read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Bus(threading.Thread):
    """The newest force, status and shape that kneadd told, by its LCM messages: proto/*.lcm, big endian."""

    def __init__(self):
        super().__init__(daemon=True)
        self.force_n = self.mesh_tick = self.generation = 0
        self.tool_at = [0, 0, 0]
        self.tick = 0  # tick of the newest status
        self.missed = self.unexplained = 0  # missed cycles; those that the machine does not explain
        # number of statuses, one per second; number with more unexplained misses than the one before
        self.statuses = self.spoilt = 0
        self.rest = self.now = None  # heights of the vertices
        self.sockets = [self.join(port) for port in (7667, 7668)]
        self.start()

    @staticmethod
    def join(port):
        s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        s.bind(("239.255.76.67", port))
        membership = socket.inet_aton("239.255.76.67") + socket.inet_aton("127.0.0.1")
        s.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        return s

    def run(self):
        threading.Thread(target=self.listen, args=[self.sockets[1]], daemon=True).start()
        self.listen(self.sockets[0])

    def listen(self, s):
        while True:
            datagram = s.recv(65536)
            channel, _, payload = datagram[8:].partition(b"\0")
            if channel.startswith(b"KNEAD_FORCE_"):
                self.force_n = sum(f * f for f in struct.unpack_from(">3d", payload, 104)) ** 0.5
                self.tool_at = struct.unpack_from(">3d", payload, 152)
            elif channel == b"KNEAD_STATUS":
                self.tick, self.missed, explained = struct.unpack_from(">3q", payload, 24)
                self.statuses += 1
                self.spoilt += self.missed - explained > self.unexplained
                self.unexplained = self.missed - explained
            elif channel == b"KNEAD_MESH_UPDATE":
                self.mesh_tick = struct.unpack_from(">q", payload, 24)[0]
                self.generation, _, chunks, first, count = struct.unpack_from(">5i", payload, 32)
                if chunks == 1:  # always true for the small scene
                    self.now = struct.unpack_from(f">{3 * count}f", payload, 65)[2::3]
                    self.rest = self.rest or self.now

    def dent_mm(self):  # largest depth of a vertex below its place at rest
        return 1e3 * max(rest - now for rest, now in zip(self.rest, self.now)) if self.now else 0

    def dented(self, mm=0.5):  # number of vertices at least that far below their place at rest
        return sum(1e3 * (rest - now) > mm for rest, now in zip(self.rest, self.now)) if self.now else 0


class Browser:
    """Headless Chromium on one page, driven by real pointer, touch and key events."""

    def __init__(self, width=1280, height=800):
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service
        os.environ["HOME"] = os.getcwd()  # files left behind are removed with the scratch folder
        options = webdriver.ChromeOptions()
        options.binary_location = "/usr/bin/chromium"
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        options.accept_insecure_certs = True  # as a user who has compared the fingerprint
        for flag in ("headless=new", "no-sandbox", "disable-gpu", "enable-unsafe-swiftshader", "disable-quic", "no-first-run", "disable-sync",
                     "disable-background-networking", "disable-component-update", "hide-scrollbars",
                     f"window-size={width},{height}", f"user-data-dir={os.getcwd()}/chromium"):
            options.add_argument("--" + flag)
        self.driver = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
        self.run = self.driver.execute_script
        self.x = self.y = 0

    def devtools(self, command, **arguments):
        return self.driver.execute_cdp_cmd(command, arguments)

    def open(self, address):
        self.driver.get(address)
        return until(lambda: self.run("return knead.frames > 3"), 20)

    def now(self):  # the newest state that the page received
        return self.run("return knead.now") or {}

    def text(self, id):
        return self.run("return document.getElementById(arguments[0]).textContent", id)

    def place(self, u, v):  # window pixels of a point of the picture
        x, y, w, h = self.run("const b = canvas.getBoundingClientRect(); return [b.x, b.y, b.width, b.height]")
        return x + u * w, y + v * h

    def mouse(self, kind, x, y, button="left", held=1):
        self.x, self.y = x, y
        self.devtools("Input.dispatchMouseEvent", type="mouse" + kind, x=x, y=y, clickCount=int(kind != "Moved"),
                      button="none" if kind == "Moved" else button, buttons=held)

    def top(self):  # where the middle of the object's top is in the picture
        return tuple(self.run("return seenAt(camera(), [0, 0, about.object.high[2]])"))

    def hover(self, u, v):
        self.mouse("Moved", *self.place(u, v), held=0)

    def press(self, u, v):
        self.hover(u, v)
        self.mouse("Pressed", self.x, self.y)

    def wheel(self, mm):  # turn the wheel: positive goes deeper
        self.devtools("Input.dispatchMouseEvent", type="mouseWheel", x=self.x, y=self.y, deltaX=0, deltaY=200 * mm,
                      buttons=1)

    def release(self):
        self.mouse("Released", self.x, self.y, held=0)

    def key(self, kind, key, code=None, text=""):
        self.devtools("Input.dispatchKeyEvent", type="key" + kind, key=key, code=code or key,
                      text=text if kind == "Down" else "")

    def complaints(self):  # messages of our page on the console
        ours = lambda words: not words.startswith("chrome://") and "GPU stall due to ReadPixels" not in words  # keep reads
        return [line for line in self.driver.get_log("browser") if ours(line["message"])]

    def screenshot(self, path):
        self.driver.save_screenshot(path)

    def keep(self, name):  # keep the picture for a comparison
        self.run("""redraw(true);
            const { width, height } = canvas;
            const copy = Object.assign(document.createElement('canvas'), { width, height });
            const ctx = copy.getContext('2d', { willReadFrequently: true });
            copyPicture(ctx, width, height);
            (window.pictures ??= {})[arguments[0]] = ctx.getImageData(0, 0, width, height).data""", name)

    def changed(self, a, b):  # number of pixels of picture b that differ from a's by more than JPEG noise
        return self.run("""let [a, b] = [...arguments].map((n) => pictures[n]), count = 0;
            for (let i = 0; i < a.length; i += 4) count += Math.abs(a[i] - b[i]) + Math.abs(a[i + 1] - b[i + 1]) > 24;
            return count""", a, b)
