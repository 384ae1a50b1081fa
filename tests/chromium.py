"""Chromium without a window, where one is installed: what pages log, how wide they are, pictures of them."""

import base64
import json
import os
import shutil
import subprocess
import tempfile
from contextlib import contextmanager

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
PATH = next((found for found in map(shutil.which, NAMES) if found), None)
# Seconds for any one answer.
PATIENCE = 60
# What a browser logs that is the page's fault.
FAULTS = ("error", "warning", "assert")


class Chromium:
    """A page at a time, spoken to through a pipe in the DevTools protocol."""

    def __init__(self, to, back):
        self.to, self.back, self.count, self.faults, self.loaded = to, back, 0, [], False
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.ask(f"{domain}.enable")

    def ask(self, method, **params):
        self.count += 1
        message = {"id": self.count, "method": method, "params": params}
        if method.split(".")[0] != "Target":
            message["sessionId"] = self.session
        self.to.write(json.dumps(message).encode() + b"\0")
        self.to.flush()
        while (answer := self._next()).get("id") != self.count:
            self._note(answer)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    def _next(self):
        text = bytearray()
        while (byte := self.back.read(1)) != b"\0":
            if not byte:
                raise RuntimeError("the browser has gone")
            text += byte
        return json.loads(text)

    def _note(self, event):
        method, params = event.get("method"), event.get("params", {})
        if method == "Page.loadEventFired":
            self.loaded = True
        elif method == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            self.faults.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Runtime.consoleAPICalled" and params["type"] in FAULTS:
            self.faults.append(" ".join(str(each.get("value", each.get("description"))) for each in params["args"]))
        elif method == "Log.entryAdded" and params["entry"]["level"] in FAULTS:
            self.faults.append(f"{params['entry']['text']} {params['entry'].get('url', '')}")

    def open(self, url, width=1280, height=800, scheme="light"):
        """Load a page as it is on a screen of that width [px]; what went wrong in it is in `faults`."""
        self.faults, self.loaded = [], False
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        self.ask("Page.navigate", url=url)
        while not self.loaded:
            self._note(self._next())

    def value(self, expression):
        return self.ask("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def picture(self, path, whole=False):
        data = self.ask("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        path.write_bytes(base64.b64decode(data))


@contextmanager
def chromium():
    """A browser of one's own, without the network; it ends with the block."""
    to_read, to_write = os.pipe()
    back_read, back_write = os.pipe()

    def as_three_and_four():
        # duplicated out of the way first: 3 and 4 may be among them
        ours = [os.dup(to_read), os.dup(back_write)]
        held = [os.dup(fd) for fd in ours]
        for fd, wanted in zip(held, (3, 4), strict=True):
            os.dup2(fd, wanted)

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        flags = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"]
        flags += ["--host-resolver-rules=MAP * ~NOTFOUND", f"--user-data-dir={profile}", "--remote-debugging-pipe"]
        process = subprocess.Popen(
            [PATH, *flags, "about:blank"],
            close_fds=False,
            preexec_fn=as_three_and_four,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_read)
        os.close(back_write)
        try:
            with os.fdopen(to_write, "wb") as to, os.fdopen(back_read, "rb", buffering=1 << 16) as back:
                yield Chromium(to, back)
        finally:
            process.kill()
            process.wait()
