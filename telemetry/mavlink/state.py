"""What the vehicle knows of the flight: the newest row, the feedback of the sticks, and what follows from both."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from rtsim.arrays import FloatArray
from rtsim.frame import COLUMN, SIGNAL_COUNT
from rtsim.units import to_deg
from telemetry.exchange.ring import TIMING_COUNT
from telemetry.mavlink.config import Ratings
from telemetry.mavlink.exchange import Feedback

PILOT_MOCM, PILOT_EXTERNAL, PILOT_HOLD = 0, 1, 2
"""Values of the row's ``pilot_mode``."""
INPUT_NONE, INPUT_LIVE, INPUT_LOST = 0, 1, 2
"""Values of ``Feedback.input_state``."""
STALL_S = 1.0
"""A flight that gives no sign of life for this long does not answer [s]."""
VTOL_TO_AIRPLANE, VTOL_TO_HELICOPTER, VTOL_HELICOPTER, VTOL_AIRPLANE = 1, 2, 3, 4
"""MAV_VTOL_STATE."""


@dataclass(slots=True)
class FlightState:
    """The flight as last heard of."""

    rate_hz: float
    """Frames per second."""
    ratings: Ratings = field(default_factory=Ratings)
    """What torque and rotor speed are shares of."""
    row: FloatArray = field(default_factory=lambda: np.zeros(SIGNAL_COUNT))
    """Newest frame row."""
    timing: FloatArray = field(default_factory=lambda: np.zeros(TIMING_COUNT))
    """Its timing columns."""
    feedback: Feedback = field(default_factory=Feedback)
    """Newest feedback of the sticks."""
    started: bool = False
    """Whether any row has come."""
    armed: bool = False
    """The flag ground stations set; it does not stop the rotors."""
    boot_s: float = 0.0
    """Simulated time since the start of this process's flight, going on over resets [s]."""
    vtol_state: int = VTOL_HELICOPTER
    """MAV_VTOL_STATE."""
    worst_level: int = 0
    """Highest corridor level of the rows since the last tick."""
    stalled: bool = False
    """Whether the flight's process gives no sign of life though it flies or stands still on purpose."""
    before_reset_s: float = 0.0
    """Simulated time flown before the last reset [s]."""
    _arrival_s: float = 0.0
    _life_sign: int = 0
    _life_sign_at: float = 0.0
    _life_sign_gap: float = 0.0

    def observe(self, rows: FloatArray, now: float) -> bool:
        """Take new rows.

        Args:
            rows: Full rows (signals, then timing), oldest first.

        Returns:
            Whether the flight started again in them (a reset).
        """
        if not len(rows):
            return False
        times = rows[:, COLUMN.time_s]
        reset = False
        for time in times.tolist():
            if self.started and time < self.boot_s - self.before_reset_s:
                # Clients take a clock that jumps back for a reboot, so theirs goes on.
                self.before_reset_s = self.boot_s + 1.0 / self.rate_hz - time
                reset = True
            self.boot_s = self.before_reset_s + time
            self.started = True
        self.row, self.timing = rows[-1, :SIGNAL_COUNT], rows[-1, SIGNAL_COUNT:]
        self.worst_level = max(self.worst_level, int(np.max(rows[:, COLUMN.corridor_level])))
        self._arrival_s = now
        return reset

    def watch_flight(self, life_sign: int, now: float) -> bool:
        """Notice whether the flight's process lives; one that is flown slowly may take its time.

        Args:
            life_sign: A count that it moves on; 0 while nothing flies.

        Returns:
            Whether that changed just now.
        """
        if life_sign != self._life_sign:
            if self._life_sign:
                self._life_sign_gap = max(now - self._life_sign_at, 0.9 * self._life_sign_gap)
            self._life_sign, self._life_sign_at = life_sign, now
        patience = max(STALL_S, 3.0 * self._life_sign_gap)
        before, self.stalled = self.stalled, life_sign != 0 and now - self._life_sign_at > patience
        return self.stalled != before

    def value(self, name: str) -> float:
        """A signal of the newest row; 0 where it is not finite.

        Args:
            name: Name of the signal.
        """
        number = float(self.row[getattr(COLUMN, name)])
        return number if math.isfinite(number) else 0.0

    def boot_ns(self, now: float) -> int:
        """Simulated time of this moment: the newest row's, carried on for up to two frames [ns]."""
        ahead = min(max(now - self._arrival_s, 0.0), 2.0 / self.rate_hz) if self.started else 0.0
        return int((self.boot_s + ahead) * 1e9)

    @property
    def boot_ms(self) -> int:
        """Time stamp of the newest row [ms]."""
        return round(self.boot_s * 1e3) & 0xFFFFFFFF

    @property
    def boot_us(self) -> int:
        """Time stamp of the newest row [us]."""
        return round(self.boot_s * 1e6)

    @property
    def pilot(self) -> int:
        """Who flies, as in the row."""
        return int(self.value("pilot_mode"))

    @property
    def input_lost(self) -> bool:
        """A person flies, or should, and the sticks are silent."""
        return self.pilot == PILOT_EXTERNAL and int(self.feedback.input_state) == INPUT_LOST

    @property
    def torque_pct(self) -> float:
        """Torque of the more loaded mast in per cent of its limit in this mode of flight."""
        return max(self.share_of_torque(f"mast_torque{side}_inlb") for side in ("", "_left", "_right"))

    @property
    def flapping_deg(self) -> float:
        """Flapping of the rotor that flaps more [deg]."""
        return max(self.value(f"flapping{side}_deg") for side in ("", "_left", "_right"))

    def share_of_torque(self, name: str) -> float:
        """A mast torque in per cent of its limit in this mode of flight.

        Args:
            name: Its column.
        """
        full = self.ratings
        upright = self.value("nacelle_deg") > full.hover_nacelle_deg
        helicopter = upright and self.value("airspeed_kt") < full.hover_airspeed_kt
        limit = full.hover_torque_inlb if helicopter else full.torque_inlb
        return 100.0 * self.value(name) / limit

    @property
    def rotor_speed_pct(self) -> float:
        """Rotor speed in per cent of the conversion speed."""
        return 100.0 * self.value("rotor_speed_rpm") / self.ratings.rotor_speed_rpm

    @property
    def nacelle_command_deg(self) -> float:
        """Angle the conversion actuator is commanded to [deg]."""
        if self.feedback.input_state:
            return to_deg(self.feedback.nacelle_command)
        return self.value("nacelle_reference_deg")

    @property
    def shown_stick(self) -> float:
        """Longitudinal stick as the hands hold it; the acting one while nobody's hands fly."""
        return self.feedback.stick if self.pilot == PILOT_EXTERNAL else self.value("stick")

    @property
    def shown_lever(self) -> float:
        """Power lever as the hands hold it; the acting one while nobody's hands fly."""
        return self.feedback.lever if self.pilot == PILOT_EXTERNAL else self.value("lever")

    @property
    def shown_lateral_stick(self) -> float:
        """Lateral stick as the hands hold it; the acting one while nobody's hands fly."""
        return self.feedback.lateral if self.pilot == PILOT_EXTERNAL else self.value("lateral_stick")

    @property
    def shown_pedal(self) -> float:
        """Pedals as the feet hold them; the acting ones while nobody's feet fly."""
        return self.feedback.yaw if self.pilot == PILOT_EXTERNAL else self.value("pedal")

    def update_vtol_state(self) -> None:
        """Helicopter above 85 deg, airplane below 2 deg, else the way the nacelles move, moved last, or are sent."""
        angle, rate = self.value("nacelle_deg"), self.value("nacelle_rate_deg_s")
        asked = int(self.feedback.transition)
        if asked == VTOL_AIRPLANE and angle >= 2.0:
            self.vtol_state = VTOL_TO_AIRPLANE
        elif asked == VTOL_HELICOPTER and angle <= 85.0:
            self.vtol_state = VTOL_TO_HELICOPTER
        elif angle > 85.0:
            self.vtol_state = VTOL_HELICOPTER
        elif angle < 2.0:
            self.vtol_state = VTOL_AIRPLANE
        elif rate < -0.05:
            self.vtol_state = VTOL_TO_AIRPLANE
        elif rate > 0.05:
            self.vtol_state = VTOL_TO_HELICOPTER
        elif self.vtol_state == VTOL_HELICOPTER:
            self.vtol_state = VTOL_TO_AIRPLANE
        elif self.vtol_state == VTOL_AIRPLANE:
            self.vtol_state = VTOL_TO_HELICOPTER
