"""Sampled control: the plant with actuator and delay, the loop, its margins."""
