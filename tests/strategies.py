"""Random drivelines for property tests."""

from hypothesis import strategies as st

import powertrain_ctrl as pt


def log_floats(low, high):
    """Floats spread evenly over decades."""
    return st.floats(low, high).map(lambda x: 10.0**x)


ratios = st.sampled_from([-6.0, -1.0, 0.5, 1.0, 2.5, 3.6, 18.0])


@st.composite
def trees(draw, most=7, damped=True):
    """Branched trees of inertias: springs, geared springs with a massless node, dampers, a spring to ground now and then."""
    count = draw(st.integers(2, most))
    elements = [pt.Inertia(f"J{i}", J=draw(log_floats(-2.0, 1.0))) for i in range(count)]
    for i in range(1, count):
        parent = f"J{draw(st.integers(0, i - 1))}"
        stiffness = draw(log_floats(1.0, 5.0))
        damping = draw(st.floats(0.0, 5.0)) if damped else 0.0
        start = parent
        if draw(st.booleans()):
            start = f"shaft_start{i}"
            elements.append(pt.Gear(f"gear{i}", parent, start, ratio=draw(ratios)))
        elements.append(pt.SpringDamper(f"spring{i}", start, f"J{i}", stiffness=stiffness, damping=damping))
    return pt.Driveline(*elements)
