"""A small made-up tiltrotor for tests of the database: eight states in an order of its own, so that nothing can rely on
the XV-15's seventeen. It is smooth, has a stall, and its trims are closed-form enough to be solved by a root finder."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from scipy.optimize import root

from rtsim.aircraft.variables import Variable
from rtsim.lpv.building.build import GridPoint, build_database
from rtsim.lpv.building.grid import Grid
from rtsim.units import GRAVITY

STATES = ("collective", "pitch", "u", "w", "q", "altitude", "disc", "elevator")
INPUTS = ("lever", "stick", "nacelle_rate", "nacelle_acceleration", "gust_u", "gust_w", "gust_q")


def _variables(names):
    roles = {"collective": "actuator", "disc": "rotor"}  # the other names are known
    return tuple(Variable(name, "", name, roles.get(name, "")) for name in names)


@dataclass(frozen=True)
class ToyAircraft:
    states: tuple = _variables(STATES)
    inputs: tuple = _variables(INPUTS)
    outputs: tuple = _variables(("load_factor", "thrust", "wing_angle_of_attack"))
    attributes: dict = field(default_factory=lambda: {"title": "toy"})

    def rotor_speed(self, _nacelle):
        return 60.0

    def forces(self, x, u, n):
        collective, _, su, sw, q, _, disc, elevator = x
        ua, wa, qa = su + u[4], sw + u[5], q + u[6]
        speed = math.hypot(ua, wa) + 1e-9
        alpha = wa / math.hypot(ua, 3.0)
        lift = 0.012 * speed**2 * math.sin(2.0 * alpha + 0.3) * (1.0 - 0.4 * math.tanh(3.0 * (alpha - 0.3)))
        drag = 0.0015 * speed**2 * (1.0 + 3.0 * alpha**2)
        axial = ua * math.cos(n) - wa * math.sin(n)
        thrust = 14.0 * collective - 0.08 * axial
        tilt = n + disc
        fx = thrust * math.cos(tilt) - drag * math.cos(alpha) + lift * math.sin(alpha)
        fz = -thrust * math.sin(tilt) - lift * math.cos(alpha) - drag * math.sin(alpha) - 0.3 * wa
        moment = (
            -1.2 * disc * thrust / 10.0
            - 0.0007 * speed**2 * (elevator + 0.15 * alpha)
            - 0.8 * qa
            + 0.05 * math.cos(n) * thrust / 10.0
            - 0.02 * u[3]
        )
        return fx, fz, moment, thrust, alpha

    def derivative(self, x, u, n):
        collective, pitch, su, sw, q, _, disc, elevator = x
        fx, fz, moment, _, _ = self.forces(x, u, n)
        return np.array(
            [
                (u[0] - collective) / 0.15,
                q,
                fx - GRAVITY * math.sin(pitch) - q * sw,
                fz + GRAVITY * math.cos(pitch) + q * su,
                moment,
                su * math.sin(pitch) - sw * math.cos(pitch),
                (0.2 * u[1] * math.sin(n) - disc - 0.05 * (q + u[2]) - 0.001 * su * math.sin(n)) / 0.1,
                (0.3 * u[1] - elevator) / 0.05,
            ]
        )

    def outputs_of(self, x, u, n):
        _, fz, _, thrust, alpha = self.forces(x, u, n)
        return np.array([-fz / GRAVITY, thrust, alpha])

    def solve(self, airspeed, nacelle, acceleration, guess):
        def unpack(z):
            pitch, collective, disc, elevator, stick = z
            x = np.array(
                [collective, pitch, airspeed * math.cos(pitch), airspeed * math.sin(pitch), 0, 0, disc, elevator]
            )
            return x, np.array([collective, stick, 0.0, 0.0, 0.0, 0.0, 0.0])

        def residual(z):
            x, u = unpack(z)
            f = self.derivative(x, u, nacelle)
            wanted = np.array([acceleration * math.cos(z[0]), acceleration * math.sin(z[0])])
            return np.array([f[2] - wanted[0], f[3] - wanted[1], f[4], f[6], f[7]])

        start = [0.0, 0.7, 0.0, 0.0, 0.0] if guess is None else [guess[0][1], guess[0][0], *guess[0][6:8], guess[1][1]]
        # shifted by one: the solver's step is relative, and zero pitch would make it vanish
        found = root(lambda z: residual(z - 1.0), np.add(start, 1.0), tol=1e-12).x - 1.0
        x, u = unpack(found)
        if np.abs(residual(found)).max() > 1e-8:
            return None
        return GridPoint(x, u, self.outputs_of(x, u, nacelle), self.derivative(x, u, nacelle))

    def reject(self, point, _airspeed, _nacelle):
        limits = point.x[1], point.y[2], point.u[1], point.u[0]
        return "out of limits" if np.any(np.abs(limits) > (0.6, 0.5, 1.0, 1.5)) else None

    def far_apart(self, point, neighbour):
        return abs(point.x[1] - neighbour.x[1]) > 0.3

    def jacobians(self, point, _airspeed, nacelle, _acceleration):
        def difference(f, z, step=1e-5):
            columns = []
            for k in range(z.size):
                d = np.zeros(z.size)
                d[k] = step
                columns.append((f(z + d) - f(z - d)) / (2.0 * step))
            return np.array(columns).T

        x, u, n = point.x, point.u, nacelle
        return (
            difference(lambda z: self.derivative(z, u, n), x),
            difference(lambda z: self.derivative(x, z, n), u),
            difference(lambda z: self.outputs_of(z, u, n), x),
            difference(lambda z: self.outputs_of(x, z, n), u),
            difference(lambda z: self.derivative(x, u, z[0]), np.array([n]))[:, 0],
        )

    def flap(self, _airspeed, _nacelle):
        return 0.7


@pytest.fixture(scope="session")
def toy_aircraft():
    return ToyAircraft()


@pytest.fixture(scope="session")
def toy_grid():
    airspeed, nacelle = np.linspace(-5.0, 60.0, 14), np.radians(np.linspace(0.0, 90.0, 10))
    low = np.where(np.degrees(nacelle) < 55.0, 35.0, -10.0)
    return Grid(np.array([-1.5, 0.0, 1.5]), airspeed, nacelle, airspeed[:, None] >= low[None, :])


@pytest.fixture(scope="session")
def toy_database(toy_aircraft, toy_grid):
    return build_database(toy_aircraft, toy_grid, jobs=1, edge_limit=None)
