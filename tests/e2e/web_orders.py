# Requests of several pages that interfere. Each request is answered once, by its own page's queue. No page ends
# another page's activity unasked. Driven by test_web_orders.sh.
import json
import os
import shutil
import signal
import sys
import time
from served import Served, check, until
from web_wire import TEXT, Wire, get
import served as results


class Page(Wire):
    """A wire that remembers every answer it was given, and the newest of what seldom changes."""

    def __init__(self, server):
        super().__init__(server)
        self.answers, self.about = [], {}
        until(lambda: self.hear() and self.about.get("tool") and self.about["mesh"]["nodes"])

    def hear(self):
        now = self.state()[0]
        self.answers += now["answers"] if now else []
        self.about.update(now.get("about", {}) if now else {})
        return now

    def send_request(self, id, do, **fields):
        self.send(TEXT, json.dumps({"id": id, "do": do, **fields}).encode())

    def of(self, id):
        return [a for a in self.answers if a["id"] == id]

    def waits(self, id, seconds=20):  # the answer, or None
        return until(lambda: self.hear() and self.of(id), seconds) and self.of(id)[0]

    def hears(self, what, seconds=15):
        return until(lambda: self.hear() and what(), seconds)

    def take(self, number):
        return next((t for t in self.about["recordings"] if t["number"] == number), {})


def recorded(page, number, seconds, id):
    page.send_request(id, "record")
    check(f"recording {number} runs", page.waits(id)["ok"] and page.hears(lambda: page.take(number).get("state") == "runs"),
          page.answers[-1:], page.about["recordings"])
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        page.point()
        page.hear()


def stop_while_it_waits(page, server):
    server.kneadd.send_signal(signal.SIGSTOP)  # otherwise the scene would arrive within a second
    page.send_request(10, "record")
    check("record: accepted", page.waits(10)["ok"], page.answers)
    page.hears(lambda: page.about["recording"])
    begin = time.monotonic()
    page.send_request(11, "stop", value=1)
    check("a recording is stopped while it waits for the scene", page.waits(11)["ok"], page.answers)
    check("the stopped recording ends at once and leaves no file",
          page.hears(lambda: not page.about["recording"] and not page.about["recordings"], 4),
          time.monotonic() - begin, page.about["recordings"])
    server.kneadd.send_signal(signal.SIGCONT)


def back_to_back(page, server):
    recorded(page, 2, 2, 20)
    page.send_request(21, "stop", value=2)
    check("a recording is stopped by its number", page.waits(21)["ok"] and page.hears(lambda: page.take(2).get("state") == "whole"),
          page.take(2))
    for id in 22, 60, 62:
        page.send_request(id, "play", value=2)
        page.send_request(id + 1, "verify", value=2)
        verify, play = page.waits(id + 1), page.waits(id, 30)
        check("verify during play is refused with the reason",
              verify and not verify["ok"] and "being replayed" in verify["words"], verify)
        if not play or "spoilt" not in play["words"]:  # a machine that stands still for 20 ms spoils the press
            break
    check("play is answered at its end", play and play["ok"], play)
    page.send_request(24, "verify", value=2)
    page.send_request(25, "play", value=2)
    play, verify = page.waits(25), page.waits(24, 40)
    check("play during verify is refused", verify and verify["ok"] and play and not play["ok"], verify, play)
    page.send_request(26, "play", value=2)
    page.send_request(27, "stop", value=2)
    check("a stop before the start of play is answered, and so is play", page.waits(27)["ok"] and page.waits(26)["words"] == "Stopped.",
          page.of(26), page.of(27))
    check("every request is answered once", [len(page.of(id)) for id in range(20, 28)] == [1] * 8, page.answers)


def downloads(page, server):
    bearer = f"Authorization: Bearer {server.token}"
    page.send_request(28, "verify", value=2)
    check("a verified recording has a table", page.waits(28, 40)["ok"] and page.hears(lambda: page.take(2).get("csv")), page.take(2))
    for name, begins in (("scene.yaml", b"version: 1"), ("recording/2.csv", b"tick,"), ("recording/2.lcmlog", b"\xed\xa1\xda\x01")):
        status, _, body = get(server.port, "/get/" + name, bearer)
        check(f"{name} can be downloaded", status == 200 and body.startswith(begins), status, body[:80])
    for name in "recording/2.png", "recording/7.csv":
        status, _, body = get(server.port, "/get/" + name, bearer)
        check(f"{name} does not exist", status == 404, status, body[:80])


def orders(page, server):
    asked = (("set", {"name": "k1", "value": 9000}, True, "Changed"), ("reset", {}, True, "reset"), ("undo", {}, True, "undone"),
             ("snapshot", {}, True, "saved"), ("restore", {}, True, "restored"), ("estop", {}, True, "Stopped"),
             ("recover", {}, True, "Recovered"), ("quality", {"name": "own"}, True, "Quality changed"),
             ("measure", {"name": "none"}, True, "Colours changed"), ("measure", {"name": "nosuch"}, False, "mesh.measures"))
    for id, (do, fields, good, words) in enumerate(asked, 70):
        page.send_request(id, do, **fields)
        told = page.waits(id)
        check(f"{do}: {told and told['words']}", told and told["ok"] == good and words in told["words"], told)


def stop_of_others(page, server):
    other = Page(server)
    recorded(page, 3, 1, 80)
    other.send_request(1, "verify", value=2)
    other.send_request(2, "stop", value=2)
    check("another page verifies a recording and stops the verification", other.waits(2)["ok"] and other.waits(1)["words"] == "Stopped.",
          other.answers)
    check("a stopped verification leaves no CSV", not os.path.exists(f"{server.folder()}/2.csv"))
    other.send_request(3, "stop", value=1)
    check("a stop of a finished recording is refused", not other.waits(3)["ok"], other.answers)
    check("the running recording continues", page.hears(lambda: page.take(3).get("state") == "runs"), page.take(3))
    page.send_request(31, "stop", value=3)
    check("the running recording is stopped by its number", page.waits(31)["ok"], page.of(31))
    other.close()


def own_answers(page, server):
    deaf = Page(server)
    for i in range(40):  # and do not read
        deaf.send_request(100 + i, "view", azimuth=28, elevation=27, zoom=1)
    time.sleep(0.3)
    for i in range(8):
        page.send_request(40 + i, "draw", name="mesh")
        check(f"request {i + 1} is answered beside a page that does not read", page.waits(40 + i, 5), page.answers[-3:])
    deaf.waits(100)
    check("a page that does not read loses only its own answers", 0 < len(deaf.answers) <= 40, len(deaf.answers))
    deaf.send_request(200, "draw", name="mesh")
    check("the page is answered again once it reads", deaf.waits(200, 5), deaf.answers[-3:])
    deaf.close()


def scenes(page, server):
    listed = lambda: page.about["scenes"]
    check("the available scenes are listed by name", listed() == ["b.yaml", "dough-small.yaml"], listed())
    check("the number of unlisted scenes is reported", page.about["unlisted"] == 2, page.about.get("unlisted"))
    shutil.copy("mine/b.yaml", "mine/a.yaml")
    check("a new scene file is listed without a restart", page.hears(lambda: listed()[0] == "a.yaml"), listed())
    for i in range(40):
        shutil.copy("mine/b.yaml", f"mine/many-{i:02}.yaml")
    check("the first 32 of many scenes are listed by name", page.hears(lambda: len(listed()) == 32 and listed()[-1] == "many-28.yaml"), listed())
    check("the number of the other scenes is reported", page.about["unlisted"] == 13, page.about["unlisted"])
    shutil.copy(f"{os.environ['KN_SOURCE']}/core/scenes/dough.yaml", "mine/many-00.yaml")
    page.send_request(50, "scene", name="many-00.yaml")
    check("a scene file that came later is loaded",
          page.waits(50)["ok"] and page.hears(lambda: page.about["scene"] == "many-00.yaml", 20), page.of(50))


def recording_of_nothing(page, server):
    server.kneadd.terminate()
    server.kneadd.wait(10)
    time.sleep(1)
    page.send_request(91, "record")
    page.hears(lambda: page.about["recording"])
    begin = time.monotonic()
    server.web.terminate()
    code = server.web.wait(15)
    took = time.monotonic() - begin
    check("knead web exits with 0 within 4 s while a recording waits for its scene", code == 0 and took < 4, code, took)
    check("knead web leaves no temporary files", os.listdir("tmp") == [], os.listdir("tmp"))


def no_folder(server):
    for folder, words in (os.getcwd() + "/nosuch", "No such file"), (os.getcwd() + "/" + 40 * "x", "39 characters"):
        os.environ["TMPDIR"] = folder
        server.start("few", ["knead", "web"], "http://")
        said = open("few.log").read()
        check(f"TMPDIR {folder[-8:]}: the effect is reported at the start", words in said and folder in said, said)
        server.last.terminate()
        server.last.wait(10)


def main():
    os.makedirs("mine"), os.makedirs("tmp")
    source = f"{os.environ['KN_SOURCE']}/core/scenes/dough-small.yaml"
    for name in "b.yaml", "dough-small.yaml", "my scene.yaml", "gr\u00fc\u00df.yaml", ".hidden.yaml", "b.txt":
        shutil.copy(source, "mine/" + name)
    os.environ["TMPDIR"] = "tmp"
    server = Served("dough-small.yaml", "--scenes", "mine")
    server.folder = lambda: "tmp/" + os.listdir("tmp")[0]
    page = Page(server)
    for part in stop_while_it_waits, back_to_back, downloads, orders, stop_of_others, own_answers, scenes, recording_of_nothing:
        part(page, server)
    no_folder(server)
    sys.exit(results.failed)


main()
