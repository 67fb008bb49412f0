"""What a search varies: the classes of a campaign, or the hands and the air around a scenario."""

from __future__ import annotations

from pathlib import Path

import tomli_w

from rtsim.toml_file import parse_toml, shipped_names
from scenarios.campaign.spec import LIBRARY, CampaignFile, load_campaign, parse_campaign
from scenarios.falsification.scenario_tables import rounded
from scenarios.files.loader import load_scenario

DEFAULT_SUBJECT = "misuse"
"""Campaign that is searched where nothing is named."""
CORRIDOR_KEPT = "always eventually[0:0.1] (margin_kt >= -0.5)"
"""Property where none is asked: the corridor is never left by more than 0.5 kn for longer than 0.1 s."""
BANDWIDTH_HZ = 0.5
"""Bandwidth of the movements of hands around a scenario [Hz]."""
HANDS = {"stick": 0.3, "lever": 0.2, "lateral_stick": 0.3, "pedal": 0.3}
"""Largest movement of each control around a scenario, in shares of its half travel (the lever's whole)."""
LARGEST_GUST_KT = 15.0


def subject_of(name_or_path: str | None, *, bandwidth_hz: float = BANDWIDTH_HZ) -> tuple[CampaignFile, str, str]:
    """Find what is to be varied.

    Args:
        name_or_path: A campaign or a scenario, by the name under which it comes with rtsim or by its path.
        bandwidth_hz: Bandwidth of the movements of hands around a scenario [Hz].

    Returns:
        The campaign, its text, and where it came from.

    Raises:
        InputError: There is no such thing, or it is wrong.
    """
    name = name_or_path or DEFAULT_SUBJECT
    if name in shipped_names(LIBRARY) or _is_campaign(name):
        return (*load_campaign(name), name)
    scenario = load_scenario(name)
    where = str(Path(name).resolve()) if name.endswith(".toml") or "/" in name else scenario.name
    text = around_scenario(where, scenario.name, scenario.duration, bandwidth_hz)
    spec, problems = parse_campaign(text, file=name)
    if spec is None:
        raise problems[0]
    return spec, text, name


def around_scenario(where: str, name: str, duration_s: float, bandwidth_hz: float) -> str:
    """The text of a campaign of one class: a scenario, with hands that do not keep still, and a gust.

    Args:
        where: The scenario, as a campaign finds it.
        name: Its name.
        duration_s: Its length [s].
        bandwidth_hz: Bandwidth of the movements [Hz].
    """
    moved = max(duration_s - 2.0, 0.5 / bandwidth_hz)
    signals = [
        {
            "channel": channel,
            "begin_s": 1.0,
            "duration_s": rounded(moved),
            "bandwidth_hz": bandwidth_hz,
            "amount": {"uniform": [-amount, amount]},
        }
        for channel, amount in HANDS.items()
    ]
    gust = {"uniform": [-LARGEST_GUST_KT, LARGEST_GUST_KT]}
    whole = {
        "time_s": {"uniform": [0.0, max(duration_s - 5.0, 0.5)]},
        "duration_s": {"uniform": [1.0, 5.0]},
        "ahead_kt": gust,
        "below_kt": gust,
        "lateral_kt": gust,
    }
    title = f"{name} with movements of up to {bandwidth_hz:g} Hz on every control, a gust, and a pilot who may yield"
    item = {
        "name": "around",
        "title": title[:200],
        "scenarios": [where],
        "signals": signals,
        "gusts": [whole],
        "pilot": {"yields": 0.5, "reaction_s": {"uniform": [0.5, 2.0]}},
    }
    content = {
        "format": 1,
        "name": f"around_{name}"[:100],
        "title": title[:200],
        "duration_s": duration_s,
        "classes": [item],
    }
    return tomli_w.dumps(content)


def _is_campaign(name: str) -> bool:
    path = Path(name)
    if path.suffix != ".toml" or not path.is_file():
        return False
    try:
        return "classes" in parse_toml(path.read_text(encoding="utf-8-sig"), file=name)
    except (OSError, ValueError):
        return False
