"""Drivelines with clutches over time: exact motion in one mode, events, simulation."""
