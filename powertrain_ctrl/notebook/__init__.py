"""What a notebook shows: sliders for any car, and a schematic for a driveline."""
