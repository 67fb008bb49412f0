"""A turning conversion, flown from Python and drawn: the track over the ground, bank and airspeed over time.

python examples/turn.py [OUT.png]                            # from anywhere; by default turn.png here
"""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib.figure import Figure

import scenarios


def main() -> None:
    """Fly ``conversion_turn`` and draw it."""
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "turn.png")
    flight = scenarios.fly("conversion_turn", speed="max")
    figure = Figure(figsize=(10, 4.5), layout="constrained")
    track, bank = figure.subplots(1, 2)
    track.plot(flight["east_m"], flight["north_m"])
    track.set(xlabel="east [m]", ylabel="north [m]", title="Track", aspect="equal")
    bank.plot(flight["time_s"], flight["bank_deg"], label="bank [deg]")
    bank.plot(flight["time_s"], flight["bank_reference_deg"], "--", label="bank asked for [deg]")
    bank.plot(flight["time_s"], flight["nacelle_deg"], label="nacelle angle [deg]")
    bank.set(xlabel="time [s]", title="Turn and conversion")
    bank.legend()
    figure.savefig(out, dpi=100)
    assert flight.metrics is not None
    print(f"turned to {flight['heading_deg'][-1]:.0f} deg, bank {flight['bank_deg'].max():.1f} deg at most,")
    print(f"worst corridor margin {flight.metrics.corridor.worst_margin_kt:.1f} kn; drawn in {out}")


if __name__ == "__main__":
    main()
