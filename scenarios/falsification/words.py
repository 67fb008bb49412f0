"""What happens in a counterexample, in words."""

from __future__ import annotations

from typing import Any

import numpy as np

from rtsim.frame import COLUMN
from rtsim.properties.formula import Robustness
from scenarios.campaign.trial import TrialFlight
from scenarios.falsification.scenario_tables import Tables


def told(tables: Tables, law: str, formula: str, robustness: Robustness, flight: TrialFlight) -> str:
    """Say what is done and what comes of it, in a few sentences.

    Args:
        tables: The scenario.
        law: The law that was flown.
        formula: The property.
        robustness: How far it was broken.
    """
    start = tables["start"]
    done = [f"From {start['airspeed_kt']:.3g} kn with the nacelles at {start['nacelle_deg']:.3g} deg:"]
    actions = [*_asked(tables), *_moved(tables), *_air(tables), *_failed(tables)]
    done.append("; ".join(actions) + "." if actions else "nothing is done.")
    rows = flight.rows
    frame = min(int(np.searchsorted(rows[:, COLUMN.time_s], robustness.time)), len(rows) - 1)
    row = rows[frame]
    where = f"{row[COLUMN.airspeed_kt]:.0f} kn, nacelles {row[COLUMN.nacelle_deg]:.0f} deg"
    done.append(
        f"With {law}, '{robustness.decides}' is missed by {_amount(robustness)} at {robustness.time:.1f} s ({where})."
    )
    done.append(f"Property: {formula}")
    return " ".join(done)


def _amount(robustness: Robustness) -> str:
    return f"{abs(robustness.value):.3g} {robustness.unit}".rstrip()


def _asked(tables: Tables) -> list[str]:
    """What the programme asks for, by its last point."""
    points = tables["programme"]["points"]
    first, last, found = points[0], points[-1], []
    for key, words, unit in (("airspeed_kt", "airspeed", "kn"), ("nacelle_deg", "nacelles", "deg")):
        if abs(first[key] - last[key]) > 1e-6:
            found.append(f"the programme goes for {words} {last[key]:.3g} {unit}")
    for key, words in (("bank_deg", "bank {:.3g} deg"), ("turn_rate_deg_s", "a turn of {:.3g} deg/s")):
        asked = max((point.get(key, 0.0) for point in points), key=abs)
        if asked:
            found.append(f"the programme asks for {words.format(asked)}")
    return found


def _moved(tables: Tables) -> list[str]:
    pulses = tables.get("pulses", [])
    shown = [_movement(pulse) for pulse in pulses[:4]]
    return shown + ([f"and {len(pulses) - 4} more movements"] if len(pulses) > 4 else [])


def _movement(pulse: dict[str, Any]) -> str:
    how = "set to" if pulse.get("replaces") else "by"
    amount = f"{pulse['amount']:+.3g}{' deg/s' if pulse['channel'] == 'switch' else ''}"
    when = f"from {pulse['time_s']:.3g} s for {pulse['duration_s']:.3g} s"
    return f"{pulse['channel'].replace('_', ' ')} {how} {amount} {when}"


def _air(tables: Tables) -> list[str]:
    air, found = tables.get("air", {}), []
    if air.get("wind_at_20_ft_kt"):
        found.append(f"turbulence of {air['wind_at_20_ft_kt']:.3g} kn")
    found += [f"a gust at {gust['time_s']:.3g} s ({_gust(gust)})" for gust in air.get("gusts", [])]
    return found


def _gust(gust: dict[str, Any]) -> str:
    return ", ".join(f"{gust[key]:+.3g} kn {key[:-3]}" for key in ("ahead_kt", "below_kt", "lateral_kt") if key in gust)


def _failed(tables: Tables) -> list[str]:
    found = []
    for fault in tables.get("faults", []):
        what = fault.get("actuator") or fault.get("control")
        words = fault["kind"].replace("-", " ") + (f" of {what.replace('-', ' ')}" if what else "")
        found.append(f"{words} at {fault['time_s']:.3g} s")
    return found
