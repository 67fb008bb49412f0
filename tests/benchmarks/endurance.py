"""Memory of every process of a long flight: recorded, logged and on the air, in real time.

    python -m tests.benchmarks.endurance [--minutes 20] [--every 5] [--csv FILE]

Reads the resident memory of the flight and of every process it starts from /proc (Linux). Says by how much each has
grown between its second minute and its last, and ends with exit code 1 where that is more than 5 %.
"""

from __future__ import annotations

import argparse
import csv
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

LARGEST_GROWTH = 0.05
"""Share by which a process may grow after its first minute."""
ROLES = ("recorder_worker", "telemetry.view", "rerun", "telemetry.mavlink", "compile_beside", "resource_tracker")
"""What the command line of a helper says of it, most telling first."""


def family(root: int) -> dict[int, str]:
    """Every process that descends from one, by number, with what it does."""
    parents, words = {}, {}
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        try:
            status = (folder / "stat").read_text()
            words[int(folder.name)] = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue  # it has ended meanwhile
        parents[int(folder.name)] = int(status.rpartition(")")[2].split()[1])
    found, grown = {root}, True
    while grown:
        more = {pid for pid, parent in parents.items() if parent in found} - found
        found, grown = found | more, bool(more)
    return {pid: _role(pid == root, words.get(pid, "")) for pid in sorted(found)}


def _role(is_root: bool, words: str) -> str:
    if is_root:
        return "flight"
    return next((role for role in ROLES if role in words), words.strip()[:40] or "?")


def resident_mb(pid: int) -> float | None:
    """Resident memory of a process [MB]; None where it has ended."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return None
    line = next((line for line in status.splitlines() if line.startswith("VmRSS:")), None)
    return None if line is None else int(line.split()[1]) / 1024.0


def fly(minutes: float, every: float, folder: Path) -> dict[str, list[tuple[float, float]]]:
    """Fly, and give the memory of each process over time, (s, MB)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        command = [
            sys.executable, "-m", "rtsim", "fly", "hover", "--headless", "--duration", str(60.0 * minutes),
            "--record", str(folder / "flight.rrd"), "--log", str(folder / "flight.parquet"),
            "--mavlink", f"127.0.0.1:{station.getsockname()[1]}",
        ]  # fmt: skip
        process = subprocess.Popen(command)
        seen: dict[str, list[tuple[float, float]]] = defaultdict(list)
        began = time.monotonic()
        while process.poll() is None:
            for pid, role in family(process.pid).items():
                memory = resident_mb(pid)
                if memory is not None:
                    seen[f"{role} ({pid})"].append((time.monotonic() - began, memory))
            time.sleep(every)
        if process.returncode:
            raise SystemExit(f"the flight ended with exit code {process.returncode}")
    return seen


def main() -> int:
    """Fly, tell and judge."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--every", type=float, default=5.0, help="seconds between two looks")
    parser.add_argument("--csv", type=Path, default=None)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        seen = fly(chosen.minutes, chosen.every, Path(folder))
        sizes = {path.name: path.stat().st_size / 1e6 for path in Path(folder).iterdir() if path.is_file()}
    if chosen.csv is not None:
        with chosen.csv.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["process", "time_s", "resident_mb"])
            writer.writerows([name, *look] for name, looks in seen.items() for look in looks)
    fat = []
    print(f"{'process':<32} {'2nd minute':>10} {'last':>10} {'most':>10}  MB   growth")
    for name, looks in seen.items():
        last = looks[-1][0]
        early = [memory for t, memory in looks if 60.0 <= t < 120.0]
        late = [memory for t, memory in looks if t >= last - 60.0]
        if not early or last < 180.0:
            continue  # it lived too briefly to grow
        first, end = statistics.median(early), statistics.median(late)
        growth = end / first - 1.0
        fat += [name] if growth > LARGEST_GROWTH else []
        most = max(memory for _, memory in looks)
        print(f"{name:<32} {first:10.1f} {end:10.1f} {most:10.1f}     {100.0 * growth:+6.1f} %")
    print("files [MB]: " + ", ".join(f"{name} {size:.1f}" for name, size in sorted(sizes.items())))
    print(f"grew by more than {100 * LARGEST_GROWTH:.0f} %: {', '.join(fat) or 'none'}")
    return 1 if fat else 0


if __name__ == "__main__":
    sys.exit(main())
