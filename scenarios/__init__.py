"""Scenarios: flights declared as data, flown live or as fast as the machine allows, and judged.

``fly`` is what most programs need; ``load_scenario`` reads a file, ``replay_log`` flies a recording again.
Its names (``__init__.pyi``) are loaded when first used, so that importing this package stays cheap.
"""

from rtsim.lazy import names_of

__getattr__, __dir__, __all__ = names_of(__name__, __file__)
