"""`Driveline`: a checked, unchangeable collection of elements and the state of its clutches."""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable, Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn, Protocol

from ..base.doors import called, checked
from ..base.errors import PowertrainError, UnknownNameError, shown, suggestion
from ..base.records import Hinted
from ..elements import Element, Statement, statement_of
from ..elements.laws import check as check_law
from . import toml
from .consistency import check_names, check_nodes, equates_motions, on_the_road, ordered_nodes
from .operating import linear_elements
from .standing import standing, stated


class HasDriveline(Hashable, Protocol):
    """Whatever is taken where a driveline is: a `Driveline`, a `TwoMass`, a `SwitchedTwoMass`."""

    @property
    def driveline(self) -> Driveline:
        """The driveline to compute with."""
        ...


# What a driveline keeps of what it has found; it is not sent to other processes, where a string has another hash.
KEPT = ("_hash", "stated", "translating")


@called
class Driveline(Hinted):
    """Driveline made of elements; a new one has its clutches locked, as many as let it turn.

    Nothing changes in place: `replace`, `lock`, `release` and `part` return a new driveline. The clutch state
    is that of the linear models; in a simulation the capacity decides. Of clutches that together would hold everything at
    rest, as the two of a dual-clutch gearbox, those given later stay released, and brakes before clutches; the driveline
    says so where it prints.

    Parameters
    ----------
    *elements : Element
        Bodies, springs, gears, clutches, ... in any order.

    Raises
    ------
    PowertrainError
        What is not an element; a name given twice, or that of a node and of another element.
    TopologyError
        No body at all; a node without inertia that only a single spring or damper touches; a spring or clutch
        between a turning node and one that moves along the road; a tyre on a body that turns.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pair = pt.Driveline(
    ...     pt.Inertia("engine", J=0.2),
    ...     pt.Inertia("wheel", J=0.8),
    ...     pt.SpringDamper("shaft", "engine", "wheel", stiffness=400.0),
    ... )
    >>> pair.replace("shaft", stiffness=1600.0)["shaft"].stiffness
    1600.0
    >>> pair
    Driveline: 3 elements, 2 nodes
      engine  Inertia                       J = 0.2 kg m^2
      wheel   Inertia                       J = 0.8 kg m^2
      shaft   SpringDamper  engine - wheel  stiffness = 400 N m/rad
    """

    _elements: dict[str, Element]
    _nodes: tuple[str, ...]
    _released: frozenset[str]

    def __init__(self, *elements: Element):
        for element in elements:
            if not isinstance(element, Element):
                raise PowertrainError(
                    f"a driveline is made of elements, got {shown(element)}; of a list: Driveline(*list)"
                )
        self._take(elements)
        vars(self)["_released"] = standing(elements, self._nodes)

    def __setattr__(self, name: str, value: Any) -> None:
        element = name if name in self._elements else "element"
        raise AttributeError(
            f'a driveline does not change; car.replace("{element}", parameter=value) is one with the value'
        )

    def _take(self, elements: tuple[Element, ...]) -> None:
        vars(self)["_elements"] = {element.name: element for element in elements}
        stated = tuple(map(statement_of, elements))
        check_names(elements, stated)
        check_nodes(elements, stated)
        vars(self)["_nodes"] = ordered_nodes(elements, stated)
        vars(self)["stated"] = stated

    @property
    def driveline(self) -> Driveline:
        """Itself; whatever has a ``driveline`` is taken where a driveline is."""
        return self

    @property
    def elements(self) -> tuple[Element, ...]:
        """Elements in the order given."""
        return tuple(self._elements.values())

    @property
    def nodes(self) -> tuple[str, ...]:
        """Node names: those with inertia of their own in the order given, then those without."""
        return self._nodes

    @property
    def clutches(self) -> tuple[str, ...]:
        """Names of clutches and brakes: of the elements that a capacity closes."""
        return tuple(e.name for e in self.elements if any(law.is_clutch for law in e.laws))

    @property
    def released(self) -> frozenset[str]:
        """Names of the clutches that are open in the linear models."""
        return self._released

    @cached_property
    def stated(self) -> tuple[Statement, ...]:
        """Rows and laws of each element, in the order of the elements."""
        return tuple(map(statement_of, self.elements))

    @cached_property
    def translating(self) -> frozenset[str]:
        """Nodes that move along the road."""
        return on_the_road(self.elements, self.stated)

    @called
    def __getitem__(self, name: str) -> Element:
        if not isinstance(name, str) or name not in self._elements:
            raise UnknownNameError("element", name, self._elements, "in this driveline")
        return self._elements[name]

    @called
    def keys(self) -> tuple[str, ...]:
        """Names of all elements."""
        return tuple(element.name for element in self.elements)

    _ipython_key_completions_ = keys

    def __add__(self, other: object) -> NoReturn:
        raise TypeError("drivelines are not added: with more elements it is pt.Driveline(*car, element)")

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._elements

    def __iter__(self) -> Iterator[Element]:
        return iter(self.elements)

    def __len__(self) -> int:
        return len(self._elements)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Driveline):
            return NotImplemented
        if self._released != other._released or len(self) != len(other):
            return False
        return all(map(_same, self.elements, other.elements))

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash((tuple(_value_hash(element) for element in self.elements), self._released))

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in KEPT}

    def rows(self) -> list[tuple[str, str, str, str]]:
        """Name, kind, nodes and values of each element, as printed.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> pt.examples.conventional().rows()[1]
        ('torsional_damper', 'Inertia', '', 'J = 0.05 kg m^2')
        """
        return [(e.name, _kind(e, self._released), _ends(e), _values(e)) for e in self.elements]

    def __repr__(self) -> str:
        rows = self.rows()
        width = [max(len(row[i]) for row in rows) for i in range(3)]
        lines = ["  " + "  ".join([*(c.ljust(w) for c, w in zip(row, width, strict=False)), row[3]]) for row in rows]
        head = f"Driveline: {len(rows)} elements, {len(self.nodes)} nodes"
        locked = [element for element in self if element.name not in self._released]
        if standing(self, self.nodes) and not standing(locked, self.nodes):
            head += f"; {', '.join(sorted(self._released))} released, with all clutches locked nothing could turn"
        return "\n".join([head, *(line.rstrip() for line in lines)])

    @called
    def replace(self, name: str | Mapping[str, Any], /, **values: Any) -> Driveline:
        """Driveline with other values of one element, or of several at once.

        Parameters
        ----------
        name : str or mapping
            Of the element; or ``"element.parameter"`` to value, for any number of elements.
        **values
            Parameters of the one element by name, those to change.

        Returns
        -------
        Driveline

        Raises
        ------
        UnknownNameError
            No element of that name.
        PowertrainError
            A parameter the element does not have, or a value that is not permitted.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> pt.examples.conventional().replace("gearbox", ratio=3.6)["gearbox"].ratio
        3.6
        >>> pt.examples.conventional().replace({"gearbox.ratio": 3.6, "vehicle.m": 2200.0})["vehicle"].m
        2200.0
        """
        if not isinstance(name, Mapping):
            return self._changed({self[name].name: values})
        if values:
            raise PowertrainError(f"{', '.join(values)}: permitted: one element and its values, or a mapping alone")
        changes: dict[str, dict[str, Any]] = {}
        for key, value in name.items():
            element, _, parameter = str(key).partition(".")
            changes.setdefault(element, {})[parameter] = value
        return self._changed(changes)

    def _changed(self, changes: Mapping[str, Mapping[str, Any]]) -> Driveline:
        elements, stated, is_alike = dict(self._elements), dict(zip(self._elements, self.stated, strict=True)), True
        for name, values in changes.items():
            element = self[name]
            for parameter in values:
                require_parameter(element, parameter)
            elements[name] = changed = dataclasses.replace(element, **values)
            for law in changed.laws:
                check_law(law, changed.nodes)
            before, stated[name] = stated[name], statement_of(changed)
            is_alike &= _outline(changed, stated[name]) == _outline(element, before)
        if not is_alike:
            return self._with(elements.values())
        # names, nodes and what they are tied to are as they were, and were checked
        new = object.__new__(Driveline)
        kept = {"_elements": elements, "stated": tuple(stated.values()), "translating": self.translating}
        vars(new).update(self.__getstate__(), **kept)
        return new

    @called
    def lock(self, *names: str) -> Driveline:
        """Driveline with these clutches locked, all of them if none is named, as in equation (2.3).

        Parameters
        ----------
        *names : str
            Of clutches and brakes.

        Returns
        -------
        Driveline

        Raises
        ------
        UnknownNameError
            No clutch of that name.
        """
        return self._with(self.elements, self._released - self._clutch_names(names))

    @called
    def release(self, *names: str) -> Driveline:
        """Driveline with these clutches open, all of them if none is named.

        Parameters
        ----------
        *names : str
            Of clutches and brakes.

        Returns
        -------
        Driveline

        Raises
        ------
        UnknownNameError
            No clutch of that name.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> sorted(pt.examples.conventional().release("clutch").released)
        ['clutch']
        """
        return self._with(self.elements, self._released | self._clutch_names(names))

    @called
    def part(self, node: str) -> Driveline:
        """What stays connected with a node: open clutches cut, locked ones hold.

        Parameters
        ----------
        node : str

        Returns
        -------
        Driveline

        Raises
        ------
        UnknownNameError
            No node of that name.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> pt.examples.conventional().release("clutch").part("engine").nodes
        ('engine', 'torsional_damper', 'clutch_primary')
        """
        for component in self.parts():
            if isinstance(node, str) and node in component:
                return self._with(e for e in self.elements if component.issuperset(e.nodes))
        raise UnknownNameError("node", node, self.nodes, "in this driveline")

    @called
    def at(
        self,
        torques: Mapping[str, float] | None = None,
        twists: Mapping[str, float] | None = None,
        speed: Mapping[str, float] | None = None,
    ) -> Driveline:
        """Linear driveline for small motion about an operating point: each law is the segment that it is in.

        Play is the shaft in contact, stages the spring of one of them, a one-way clutch that drives a rigid coupling, a tyre
        with slip a spring and a damper in series, a pendulum a spring with an inertia behind it, a torque converter a
        `SpeedCoupling` by the slopes of its torques; constant friction is left out, for small motion neither its torque nor
        its sticking is linear. Clutches stay as they are locked or released.

        Parameters
        ----------
        torques : mapping, optional
            Input ``<inertia>_torque`` [N m] or ``<mass>_force`` [N] to value: laws are in the modes that carry this steady
            load; what turns as one body accelerates. Those that are not given are 0.
        twists : mapping, optional
            Play or stages to their twist [rad], of play the whole one, instead.
        speed : mapping, optional
            Node to speed [rad/s or m/s] for what depends on it: tyres with slip, the drag of the road, pendulums (which
            without one stay as they are), and of both sides of a torque converter. All nodes turn with it.

        Returns
        -------
        Driveline

        Raises
        ------
        PowertrainError
            A point inside a gap, a speed that is needed and not given, speeds that contradict each other.
        UnknownNameError
            An input, element or node that is not there.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> car = pt.Driveline(
        ...     pt.Inertia("engine", J=0.2),
        ...     pt.Backlash("shaft", "engine", "wheel", gap=0.02, stiffness=400.0),
        ...     pt.Inertia("wheel", J=0.8),
        ... )
        >>> pt.modes(car.at(torques={"engine_torque": 50.0})).frequency_hz.round(3)
        array([0.   , 7.958])
        """
        return self._with(linear_elements(self.elements, self.nodes, self._released, torques, twists, speed))

    def parts(self) -> list[frozenset[str]]:
        """Nodes of each connected part, in the order of `nodes`."""
        group = {node: {node} for node in self.nodes}
        for element in self.elements:
            if element.name in self._released or not element.nodes:
                continue
            merged: set[str] = set().union(*(group[node] for node in element.nodes))
            for node in merged:
                group[node] = merged
        return [frozenset(g) for g in {id(group[node]): group[node] for node in self.nodes}.values()]

    @checked
    def save(self, path: str | Path) -> None:
        """Write the driveline to a TOML file that `load` reads back equal; it appears whole or not at all.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        FileError
            The folder cannot be written, or an element is named "units".
        """
        toml.write(self.elements, stated(self, self.nodes, self.released), path)

    def _with(self, elements: Iterable[Element], released: frozenset[str] | None = None) -> Driveline:
        new = object.__new__(Driveline)
        new._take(tuple(elements))
        vars(new)["_released"] = (self._released if released is None else released) & frozenset(new.clutches)
        return new

    def _clutch_names(self, names: tuple[str, ...]) -> frozenset[str]:
        for name in names:
            if name not in self.clutches:
                raise UnknownNameError("clutch", name, self.clutches, "in this driveline")
        return frozenset(names or self.clutches)


def rebuilt(car: Driveline, elements: Iterable[Element]) -> Driveline:
    """A driveline of these elements, its clutches in the state in which those of another are."""
    return car._with(elements)


def require_parameter(element: Element, parameter: str) -> None:
    """Raise a `PowertrainError` unless this is a parameter of the element, other than its name."""
    known = [item.name for item in dataclasses.fields(element)[1:]]
    if parameter not in known:
        raise PowertrainError(f'{element.name} has no parameter "{parameter}"{suggestion(parameter, known)}')


def _outline(element: Element, stated: Statement) -> tuple:
    """What of an element its driveline is checked for: anything but values."""
    return (
        element.nodes,
        element.translating,
        [row.nodes for row in stated.inertias],
        [list(row.coefficients) for row in stated.constraints],
        [(law.name, law.owner, law.held is None, list(law.coefficients)) for law in stated.laws],
        equates_motions(element, stated),
    )


def _same(one: Element, other: Element) -> bool:
    try:
        return one is other or bool(one == other)
    except ValueError:  # an element of one's own with arrays, which are not compared
        return False


def _value_hash(element: Element) -> int:
    try:
        return hash(element)
    except TypeError:  # an element of one's own with a list or an array
        return hash(element.name)


def _kind(element: Element, released: frozenset[str]) -> str:
    return type(element).__name__ + (" (released)" if element.name in released else "")


def _ends(element: Element) -> str:
    return "" if element.nodes == (element.name,) else " - ".join(element.nodes)


def _values(element: Element) -> str:
    shown = []
    for item in dataclasses.fields(element):
        value = getattr(element, item.name)
        if "unit" in item.metadata and value != item.default:
            shown.append(f"{item.name} = {value:g} {item.metadata['unit']}".rstrip())
        elif "array" in item.metadata and value != item.default:
            shown.append(f"{len(value)} {item.name}")
    return ", ".join(shown)
