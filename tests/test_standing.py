"""The clutch state of a new driveline is one that can move; files say where theirs is another one."""

import pytest

import powertrain_ctrl as pt


def dual_clutch(*, sprung=False, brake=False, first="odd"):
    """Two clutches to one output, through gears of 4 and 2.5; ``sprung`` behind input shafts that twist."""
    elements = [pt.Inertia("engine", J=0.2), pt.Inertia("output", J=3.0)]
    clutches = [pt.Clutch(f"{side}_clutch", "engine", f"{side}_drum", max_torque=300.0) for side in ("odd", "even")]
    elements += clutches if first == "odd" else clutches[::-1]
    for side, ratio in (("odd", 4.0), ("even", 2.5)):
        behind = f"{side}_shaft" if sprung else f"{side}_drum"
        elements.append(pt.Inertia(f"{side}_drum", J=0.01))
        if sprung:
            elements += [
                pt.Inertia(behind, J=0.01),
                pt.SpringDamper(f"{side}_spring", f"{side}_drum", behind, stiffness=5e4),
            ]
        elements.append(pt.Gear(f"{side}_gear", behind, "output", ratio=ratio))
    if brake:
        elements.insert(0, pt.Clutch("brake", "output", max_torque=2000.0))
    return pt.Driveline(*elements)


@pytest.mark.parametrize("sprung", [False, True])
@pytest.mark.parametrize("first", ["odd", "even"])
def test_the_clutch_given_first_of_a_dual_clutch_gearbox_is_locked_and_the_other_one_open(sprung, first):
    car = dual_clutch(sprung=sprung, first=first)
    assert car.released == {"even_clutch" if first == "odd" else "odd_clutch"}
    motion = dict(zip((model := pt.assemble(car)).nodes, model.rigid_motion, strict=True))
    assert motion["engine"] / motion["output"] == pytest.approx(4.0 if first == "odd" else 2.5, rel=1e-12)
    pt.modes(car)


def test_a_driveline_says_which_clutch_it_has_left_open_and_why():
    shown = repr(dual_clutch())
    assert "even_clutch released, with all clutches locked nothing could turn" in shown.splitlines()[0]
    assert "Clutch (released)" in shown
    # of what the user has locked or opened beside it says no such thing
    for other in (dual_clutch().lock(), dual_clutch().release()):
        assert ("nothing could turn" in repr(other)) == (other == dual_clutch().release())


def test_a_brake_gives_way_to_clutches_wherever_it_is_given():
    assert dual_clutch(brake=True).released == {"even_clutch", "brake"}


def test_a_brake_that_a_planetary_gear_turns_on_is_locked():
    gear = [
        pt.Inertia("sun", J=0.1),
        pt.Inertia("ring", J=0.1),
        pt.Inertia("carrier", J=1.0),
        pt.Planetary("set", "sun", "ring", "carrier", ratio=2.0),
    ]
    ring, carrier = (
        pt.Clutch("ring_brake", "ring", max_torque=9.0),
        pt.Clutch("carrier_brake", "carrier", max_torque=9.0),
    )
    direct = pt.Clutch("direct", "sun", "carrier", max_torque=9.0)
    assert pt.Driveline(*gear, ring).released == frozenset()
    assert pt.Driveline(*gear, ring, carrier).released == {"carrier_brake"}
    assert pt.Driveline(*gear, ring, direct).released == {"ring_brake"}


def test_clutches_side_by_side_or_in_a_row_are_all_locked():
    bodies = [pt.Inertia(name, J=0.1) for name in "abc"]
    clutches = [pt.Clutch(f"{a}{b}", a, b, max_torque=1.0) for a, b in ("ab", "bc", "ac")]
    assert pt.Driveline(*bodies, *clutches).released == frozenset()


def test_two_axles_that_roll_unequally_do_not_open_a_clutch():
    """Rigid springs would hold them, whatever the clutches do."""
    car = pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.Inertia("shaft", J=0.2),
        pt.Clutch("first", "engine", "middle", max_torque=9.0),
        pt.Inertia("middle", J=0.2),
        pt.Clutch("second", "middle", "shaft", max_torque=9.0),
        pt.Tyre("front", "shaft", "vehicle", radius=0.30, stiffness=1e5),
        pt.Tyre("rear", "shaft", "vehicle", radius=0.31, stiffness=1e5),
        pt.Mass("vehicle", m=1000.0),
    )
    assert car.released == frozenset()


@pytest.mark.parametrize("state", ["as_new", "lock", "release"])
def test_every_clutch_state_reads_back_equal(tmp_path, state):
    car = dual_clutch(brake=True)
    car = car if state == "as_new" else getattr(car, state)()
    car.save(tmp_path / "car.toml")
    assert pt.load(tmp_path / "car.toml") == car


def test_changing_a_value_leaves_the_clutches_as_they_are():
    car = dual_clutch().lock("even_clutch").release("odd_clutch")
    assert car.replace("even_gear", ratio=2.2).released == {"odd_clutch"}
    assert car.replace("engine", J=0.3).released == {"odd_clutch"}
