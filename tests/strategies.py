"""Random drivelines for property tests."""

from hypothesis import strategies as st

import powertrain_ctrl as pt


def log_floats(low, high):
    """Floats spread evenly over decades."""
    return st.floats(low, high).map(lambda x: 10.0**x)


ratios = st.sampled_from([-6.0, -1.0, 0.5, 1.0, 2.5, 3.6, 18.0])


@st.composite
def trees(draw, most=7, damped=True):
    """Branched trees of inertias on springs, some of them behind a gear with a massless node; one rigid motion."""
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


@st.composite
def drivelines(draw, most=6, geared=True):
    """Any driveline: trees as above, and pure dampers, rigid gears, a clutch, a spring that closes a loop, one to ground.

    Any of their inertias may hang on any other; a loop through gears may leave no rigid motion.
    """
    count = draw(st.integers(2, most))
    bodies = [f"J{i}" for i in range(count)]
    elements = [pt.Inertia(name, J=draw(log_floats(-1.5, 1.0))) for name in bodies]
    stiffness, damping = log_floats(1.0, 4.0), st.sampled_from([0.0, 0.3, 2.0, 40.0])
    for i in range(1, count):
        parent, body = bodies[draw(st.integers(0, i - 1))], bodies[i]
        kind = draw(st.sampled_from(["spring", "damper", "clutch", *(["geared spring", "gear"] if geared else [])]))
        if kind == "damper":
            elements.append(pt.SpringDamper(f"damper{i}", parent, body, stiffness=0.0, damping=draw(log_floats(-1, 1))))
        elif kind == "gear":
            elements.append(pt.Gear(f"gear{i}", parent, body, ratio=draw(ratios)))
        elif kind == "clutch":
            elements.append(pt.Clutch(f"clutch{i}", parent, body, max_torque=10.0))
        else:
            start = parent
            if kind == "geared spring":
                start = f"shaft_start{i}"
                elements.append(pt.Gear(f"gear{i}", parent, start, ratio=draw(ratios)))
            values = {"stiffness": draw(stiffness), "damping": draw(damping)}
            elements.append(pt.SpringDamper(f"spring{i}", start, body, **values))
    if draw(st.booleans()):
        a, b = draw(st.permutations(bodies))[:2]
        elements.append(pt.SpringDamper("across", a, b, stiffness=draw(stiffness), damping=draw(damping)))
    if draw(st.booleans()):
        node = draw(st.sampled_from(bodies))
        elements.append(pt.Drag("ground", node, stiffness=draw(stiffness), damping=draw(damping)))
    return pt.Driveline(*elements)
