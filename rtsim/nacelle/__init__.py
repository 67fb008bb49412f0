"""The nacelles: conversion actuator, rate limits, the pilot's switch with its detents."""
