"""A flight log read by rtsim, by pyarrow, and by pandas where it is installed.

    rtsim fly conversion_turn --headless --speed max --log turn.parquet
    python examples/reading_a_log.py turn.parquet                # from anywhere; without a log it flies one

A log is a folder of Parquet files: every program that reads Parquet reads it. Names of columns end with their unit.
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
from pathlib import Path

import pyarrow.compute as pc
import pyarrow.parquet as pq

import scenarios
from scenarios.flight.runner import FlightOutputs
from telemetry.log.reader import read_log

COLUMNS = ["time_s", "airspeed_kt", "nacelle_deg", "bank_deg", "flapping_deg", "margin_kt"]


def by_rtsim(path: Path) -> None:
    """What only rtsim knows: units, events, how the flight ended, and whether the rows are those that were flown."""
    log = read_log(path)
    print(f"{log.metadata.scenario_name}: {len(log.rows)} rows of {len(log.names)} signals, {len(log.events)} events")
    print(f"fastest {log['airspeed_kt'].max():.1f} {log.unit('airspeed_kt')}, SHA-256 {log.history_sha256()[:12]}...")


def by_pyarrow(path: Path) -> None:
    """Only the columns that are wanted, however long the flight."""
    table = pq.read_table(path, columns=COLUMNS)
    turn = table.filter(pc.greater(table["bank_deg"], 10.0))
    print(f"in the turn: {turn.num_rows / 250:.1f} s, flapping {pc.max(turn['flapping_deg']).as_py():.2f} deg at most")


def by_pandas(path: Path) -> None:
    """The same as a DataFrame, by phases of the conversion."""
    import pandas as pd

    frame = pd.read_parquet(path, columns=COLUMNS)
    phase = pd.cut(frame["nacelle_deg"], [-1.0, 1.0, 75.0, 91.0], labels=["airplane", "conversion", "helicopter"])
    print(frame.groupby(phase, observed=True)[["flapping_deg", "margin_kt"]].agg(["min", "max"]))


def main() -> None:
    """Read the log that is named, or one that is flown now."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(folder) / "turn.parquet"
        if len(sys.argv) == 1:
            scenarios.fly("conversion_turn", speed="max", outputs=FlightOutputs(log=path))
        by_rtsim(path)
        by_pyarrow(path)
        if importlib.util.find_spec("pandas") is not None:
            by_pandas(path)
        else:
            print("pip install pandas shows the rest")


if __name__ == "__main__":
    main()
