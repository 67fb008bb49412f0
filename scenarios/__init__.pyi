from rtsim.measures.metrics import FlightMetrics as FlightMetrics
from rtsim.measures.metrics import flight_metrics as flight_metrics
from scenarios.files.loader import library_names as library_names
from scenarios.files.loader import load_scenario as load_scenario
from scenarios.files.scenario import Scenario as Scenario
from scenarios.flight.replay import replay_log as replay_log
from scenarios.flight.result import FlightRecord as FlightRecord
from scenarios.flight.runner import fly as fly
