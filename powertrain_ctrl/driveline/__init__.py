"""A driveline as a collection of elements, its kinematics and its file."""
