"""Blade sections over angle of attack and Mach number, and what rotation does to their stall."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import NdBSpline

from rtsim.aircraft.profile import XV15_DATA
from rtsim.aircraft.xv15 import section_reader
from rtsim.aircraft.xv15.data_reader import read_data
from rtsim.aircraft.xv15.model import Xv15
from rtsim.errors import InputError
from rtsim.toml_file import shipped_toml

PRINTED = shipped_toml(XV15_DATA, "rotor_sections.toml")
MIDDLES = np.array([0.375, 0.675, 0.875, 0.975])
"""Middles of the printed regions: there nothing is blended."""
CHORD_OVER_RADIUS = 0.0933 / MIDDLES


def sections(delay, exponent=1.0):
    own = {"stall_delay": delay, "stall_delay_exponent": exponent}
    tables = section_reader.section_tables(MIDDLES, CHORD_OVER_RADIUS, own)
    knots = [(np.arange(nodes.size + 3) - 1.5) for nodes in (section_reader.ANGLES_DEG, section_reader.MACHS)]

    def look_up(region, alpha_deg, mach):
        position = [
            (np.asarray(alpha_deg, float) - section_reader.ANGLES_DEG[0]) / section_reader.ANGLE_STEP_DEG,
            np.broadcast_to((mach - section_reader.MACHS[0]) / section_reader.MACH_STEP, np.shape(alpha_deg)),
        ]
        return NdBSpline(tuple(knots), tables[region], k=2)(np.stack(position, axis=-1))

    return look_up


@pytest.mark.parametrize("region", range(4))
@pytest.mark.parametrize("mach", [0.0, 0.3, 0.4, 0.5, 0.6])
def test_printed_nodes_are_met(region, mach):
    """Without stall delay the splines meet the print: lift to 0.02, drag to 0.005 (RMS); 0.05 and 0.013 at corners.

    A corner is rounded within one interval. Source: NASA/TP-2004-212262 App. A.
    """
    table = PRINTED[f"region_{region + 1}"]
    found = sections("none")(region, PRINTED["alpha_deg"], mach)
    for kind, column, within in (("cl", 0, (0.05, 0.02)), ("cd", 1, (0.013, 0.005))):
        rows = np.array(table[f"{kind}_rows_alpha_cols_mach"])
        printed = [np.interp(mach, table[f"mach_{kind}"], row) for row in rows]
        assert np.max(np.abs(found[:, column] - printed)) < within[0]
        assert np.sqrt(np.mean((found[:, column] - printed) ** 2)) < within[1]


@pytest.mark.parametrize("region", range(4))
def test_two_transcriptions_agree_at_the_hover_mach_number(region):
    """The slice at the hover test's Mach number is the independently transcribed one within 0.02 of lift."""
    reduced = read_data()[0]["rotor"]["c81_reduced"]
    mach = MIDDLES[region] * 768.0 / 1116.45
    found = sections("none")(region, reduced["alpha_cl_deg"], mach)[:, 0]
    differences = np.abs(found - reduced[f"cl_R{region + 1}"])
    assert np.max(differences[:-2]) < 0.02  # up to 8 deg
    assert np.max(differences) < 0.1  # near stall one slice cannot tell where in its region it was taken


def test_stall_delay_factors_are_the_published_ones():
    """K of Corrigan and Schillings (exponent 1) and the lift share of Du and Selig, at four radii to three digits."""
    for radius, factor, share in (
        (0.25, 1.196, 0.564),
        (0.5, 1.134, 0.191),
        (0.75, 1.098, 0.062),
        (0.95, 1.079, 0.007),
    ):
        ratio = 1.16625 / (radius * 12.5)
        assert section_reader.corrigan_schillings_factor(ratio) == pytest.approx(factor, abs=1e-3)
        assert section_reader.du_selig_share(radius, ratio, 1.0) == pytest.approx(share, abs=3e-3)


@pytest.mark.parametrize("region", range(4))
@pytest.mark.parametrize("delay", ["corrigan_schillings", "du_selig"])
def test_rotation_delays_stall_and_leaves_the_rest(region, delay):
    """Lift beyond the stall grows, most inboard; below 2 deg, and on the stalled plate, nothing changes."""
    still, turning = sections("none"), sections(delay)
    low = np.arange(-15.0, 1.0)
    np.testing.assert_allclose(turning(region, low, 0.4)[:, 0], still(region, low, 0.4)[:, 0], atol=0.02)
    stalled = [12.0, 14.0, 16.0, 20.0]
    gain = turning(region, stalled, 0.4)[:, 0] - still(region, stalled, 0.4)[:, 0]
    assert np.all(gain >= -1e-9)
    assert gain.max() > (0.0 if region == 3 and delay == "du_selig" else 0.03)
    plate = [-90.0, -25.0, 65.0, 120.0]
    np.testing.assert_array_equal(turning(region, plate, 0.4), still(region, plate, 0.4))


def test_exponent_zero_is_no_delay():
    angles = np.arange(-170.0, 171.0, 5.0)
    for region in range(4):
        np.testing.assert_allclose(
            sections("corrigan_schillings", 0.0)(region, angles, 0.5), sections("none")(region, angles, 0.5), atol=1e-12
        )


def test_unknown_stall_delay_and_unknown_entry_are_refused():
    with pytest.raises(InputError, match="allowed: corrigan_schillings, du_selig, none"):
        Xv15.load({"rotor.stall_delay": "snel"})
    for name in ("rotor.no_such", "nothing", "rotor.stall_delay.more"):
        with pytest.raises(InputError, match="no such entry"):
            Xv15.load({name: 1.0})
