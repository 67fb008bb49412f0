"""Verdicts on envelope protection: trials, reports, bundles."""
