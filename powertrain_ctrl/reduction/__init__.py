"""Small models of a driveline: two masses, balanced, and how they compare."""
