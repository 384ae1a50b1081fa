"""Linear models of a driveline: matrices, modes, state space."""
