"""Gusts and turbulence as inputs of the plant: discrete gusts and the Dryden forms of MIL-F-8785C."""
