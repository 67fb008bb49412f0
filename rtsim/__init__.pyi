from rtsim.aircraft.xv15.model import Xv15 as Xv15
from rtsim.command import Command as Command
from rtsim.command import Margins as Margins
from rtsim.command import Reference as Reference
from rtsim.command import Sensors as Sensors
from rtsim.corridor.boundaries import Corridor as Corridor
from rtsim.corridor.boundaries import load_corridor as load_corridor
from rtsim.errors import InputError as InputError
from rtsim.errors import RtsimError as RtsimError
from rtsim.loop.options import FlightOptions as FlightOptions
from rtsim.loop.simulation import FlightSetup as FlightSetup
from rtsim.loop.simulation import Simulation as Simulation
from rtsim.lpv.aircraft import LpvAircraft as LpvAircraft
from rtsim.lpv.aircraft import load_aircraft as load_aircraft
from rtsim.pilot.design import design_mocm as design_mocm
from rtsim.pilot.problem import MocmError as MocmError
from rtsim.programme import Programme as Programme

__version__: str
