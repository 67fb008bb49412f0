"""Takes docs/figures/flightgear_conversion.jpg: a conversion in a turn, seen in FlightGear under a virtual display.

Needs Debian's flightgear (3 GB), xvfb, imagemagick and xdotool; draws without a graphics card. FlightGear's first
start takes minutes. Usage: python docs/figures/make_flightgear_figure.py
"""

from __future__ import annotations

import os
import socket
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

import scenarios
from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN, SIGNAL_COUNT
from scenarios.flight.runner import FlightOutputs
from telemetry.exchange.endpoint import Endpoint
from telemetry.flightgear.config import KEFLAVIK, WindowConfig
from telemetry.flightgear.files import START_SCRIPT, write_aircraft
from telemetry.flightgear.sender_process import datagram

HERE = Path(__file__).parent
CONFIG = WindowConfig(target=Endpoint("127.0.0.1", 5599))
OUTSIDE_S, COCKPIT_S = (8.0, 33.0, 50.0), 60.0
"""When the pictures are taken: from outside, and then from the cockpit [s]."""
SIZE = "640x400"
SLOW_MACHINE = (
    f"--geometry={SIZE}", "--fg-root=/usr/share/games/flightgear", "--disable-sound", "--disable-terrasync",
    "--disable-splash-screen", "--disable-clouds3d", "--disable-random-objects", "--disable-ai-models",
    "--texture-filtering=1", "--prop:/sim/rendering/multi-sample-buffers=0", "--visibility=9000",
    "--prop:/sim/rendering/shaders/quality-level=0", "--prop:/sim/menubar/visibility=false",
)  # fmt: skip
"""What makes FlightGear draw some pictures a second on a processor: above all no anisotropic filter."""
LONGEST_START_S = 900.0


def first_row() -> FloatArray:
    """A hover, so that FlightGear has something to show before the flight."""
    row = np.zeros(SIGNAL_COUNT)
    row[COLUMN.altitude_m], row[COLUMN.nacelle_deg], row[COLUMN.load_factor] = 100.0, 90.0, 1.0
    return row


def waiting_bytes() -> int | None:
    """What FlightGear has not read yet at its port; None while it does not listen."""
    for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]:
        words = line.split()
        if int(words[1].rpartition(":")[2], 16) == CONFIG.target.port:
            return int(words[4].rpartition(":")[2], 16)
    return None


def wait_until_it_reads() -> None:
    """Send the hover until FlightGear has taken it in a few times."""
    deadline, taken = time.monotonic() + LONGEST_START_S, 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        while taken < 10:
            if time.monotonic() > deadline:
                raise TimeoutError("FlightGear does not read its port")
            packet = datagram(first_row(), KEFLAVIK)
            assert packet is not None
            sock.sendto(packet, (CONFIG.target.host, CONFIG.target.port))
            time.sleep(2.0)
            taken = taken + 1 if waiting_bytes() == 0 else 0


class Photographer:
    """Takes pictures of the display while the flight goes on."""

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        """Load the camera.

        Args:
            folder: Where the pictures go.
            environment: Has the display.
        """
        self.pictures: list[Path] = []
        self._folder, self._environment = folder, environment
        self._times = [*OUTSIDE_S, COCKPIT_S]
        self._inside = False
        self._running: list[subprocess.Popen[bytes]] = []

    def look(self, row: FloatArray) -> None:
        """Take the picture that is due, if one is.

        Args:
            row: The newest row of the flight.
        """
        now = float(row[COLUMN.time_s])
        if not self._inside and now > OUTSIDE_S[-1] + 1.0:
            self._inside = True
            self._run("xdotool", "key", "shift+v")
        if self._times and now >= self._times[0]:
            self._times.pop(0)
            self.pictures.append(self._folder / f"{len(self.pictures)}.png")
            self._run("import", "-window", "root", str(self.pictures[-1]))

    def finish(self) -> None:
        """Wait for the last picture."""
        for process in self._running:
            process.wait(30)

    def _run(self, *command: str) -> None:
        self._running.append(subprocess.Popen(command, env=self._environment))


def main() -> None:
    """Start display and FlightGear, fly, and lay the pictures side by side."""
    with tempfile.TemporaryDirectory(prefix="rtsim-flightgear-") as temporary:
        folder = Path(temporary)
        home = Path(os.environ.get("RTSIM_FLIGHTGEAR_HOME", temporary))  # keeps the first start's cache, if set
        display = ":97"
        environment = {**os.environ, "DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1", "HOME": str(home)}
        write_aircraft(folder, listen=CONFIG.target, home=CONFIG.home)
        screen = subprocess.Popen(["Xvfb", display, "-screen", "0", f"{SIZE}x24", "-nolisten", "tcp"])
        time.sleep(1.0)
        log = (folder / "fgfs.log").open("wb")
        flightgear = subprocess.Popen(
            ["sh", str(folder / START_SCRIPT), *SLOW_MACHINE], env=environment, stdout=log, stderr=subprocess.STDOUT
        )
        try:
            wait_until_it_reads()
            photographer = Photographer(folder, environment)
            outputs = FlightOutputs(flightgear=CONFIG, on_rows=photographer.look)
            scenarios.fly("conversion_turn", outputs=outputs)
            photographer.finish()
            target = HERE / "flightgear_conversion.jpg"
            tiles = ["-tile", "2x", "-geometry", "560x350+2+2", "-quality", "82"]
            subprocess.run(["montage", *map(str, photographer.pictures), *tiles, str(target)], check=True)
        finally:
            for process in (flightgear, screen):
                process.terminate()
                process.wait(30)
            log.close()


if __name__ == "__main__":
    main()
