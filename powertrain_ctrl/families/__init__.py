"""One driveline in many variants: structure once, values with a batch axis."""
