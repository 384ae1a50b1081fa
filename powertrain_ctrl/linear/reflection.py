"""A driveline referred to one of its nodes: gear ratios and tyre radius incorporated into the values behind them."""

from __future__ import annotations

import numpy as np

from ..base.doors import checked
from ..base.errors import TopologyError, UnknownNameError
from ..driveline.collection import Driveline, HasDriveline
from ..driveline.kinematics import CANCELLED, product
from ..elements import Clutch, Compliance, Drag, Element, Inertia, Law, SpringDamper
from .assembly import TorsionalModel, as_driveline, assemble


@checked
def reflected(car: HasDriveline, reference: str | None = None) -> Driveline:
    """Driveline without gears whose every part is seen from one node, equations (2.1) to (2.7), Figs. 2.6 and 2.10.

    Behind a ratio R stand J / R^2, k / R^2 and d / R^2; the vehicle is the inertia m r^2 / R^2. What gears and
    locked clutches hold together is one body under the first of its names. Frequencies and damping are those of
    the car; speeds and torques behind a ratio are reflected, ``omega_R = R omega``, ``T_R = T / R``. A spring that joins
    more than two of these bodies, behind a differential, stays a `Compliance` with its coefficients.

    Parameters
    ----------
    car : Driveline or TwoMass
        All of it connected; with an open clutch take ``car.part(node)``.
    reference : str, optional
        Node that everything is seen from; the first one if not given.

    Returns
    -------
    Driveline

    Raises
    ------
    TopologyError
        Nodes without a single ratio to the others (a free planetary gear), or not connected with the reference.
    UnknownNameError
        A node that is not there.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> chain = pt.reflected(pt.examples.conventional(damping=None), "engine")
    >>> chain
    Driveline: 13 elements, 7 nodes
      engine            Inertia                                          J = 0.3 kg m^2
      torsional_damper  Inertia                                          J = 0.05 kg m^2
      clutch_primary    Inertia                                          J = 0.1 kg m^2
      transmission      Inertia                                          J = 0.03 kg m^2
      differential      Inertia                                          J = 0.00138889 kg m^2
      wheels            Inertia                                          J = 0.0123457 kg m^2
      vehicle           Inertia                                          J = 0.756173 kg m^2
      damper_spring     SpringDamper  engine - torsional_damper          stiffness = 2000 N m/rad
      clutch_shaft      SpringDamper  torsional_damper - clutch_primary  stiffness = 50000 N m/rad
      input_shaft       SpringDamper  clutch_primary - transmission      stiffness = 1e+06 N m/rad
      output_shaft      SpringDamper  transmission - differential        stiffness = 27777.8 N m/rad
      drive_shafts      SpringDamper  differential - wheels              stiffness = 106.173 N m/rad
      tyres             SpringDamper  wheels - vehicle                   stiffness = 370.525 N m/rad
    """
    driveline = as_driveline(car)
    model = assemble(driveline)
    scale = reflection(model, driveline.nodes[0] if reference is None else reference, every=True)
    names, T = model.coordinates + model.following.names, model.following.kinematics
    M = T.T @ model.J @ T * scale * scale[:, None]
    diagonal = np.diag(M)
    shared = np.argwhere(np.abs(np.triu(M, 1)) > CANCELLED * np.sqrt(np.outer(diagonal, diagonal)))
    if shared.size:
        a, b = (names[i] for i in shared[0])
        raise TopologyError(
            f"{a} and {b} share inertia (a Shaft or a planetary gear), so they are not a chain of bodies; in place of a "
            "Shaft take a SpringDamper with half the inertia at either end"
        )
    bodies = names[: len(model.coordinates)]
    elements: list[Element] = [Inertia(name, J=float(J)) for name, J in zip(bodies, diagonal, strict=False)]
    for name, row, k, d in zip(
        model.compliances, product(model.E, T) * scale, model.stiffness, model.damping, strict=True
    ):
        if row.any():
            elements.append(_compliance(name, _coefficients(names, row), float(k), float(d)))
    for clutch, row in zip(model.laws, model.S @ T * scale, strict=True):
        if clutch.name in driveline.released:
            elements.append(_clutch(clutch, _coefficients(names, row)))
    return Driveline(*elements).release(*driveline.released) if driveline.released else Driveline(*elements)


def reflection(model: TorsionalModel, reference: str, every: bool = False) -> np.ndarray:
    """(n,) ndarray: motion of each coordinate when everything turns as one body and the reference node by 1.

    With ``every`` (n + m,), those without inertia too.

    Raises
    ------
    TopologyError
        Nodes that are not connected with the reference.
    """
    if reference not in model.nodes:
        raise UnknownNameError("node", reference, model.nodes, "in this driveline")
    if model.parts.max() > 0:
        raise TopologyError(f'not every node is connected with "{reference}"; take car.part("{reference}")')
    motion = model.rigid_motion
    at_reference = motion[model.nodes.index(reference)]
    if not at_reference:
        raise TopologyError(f'"{reference}" rests when everything turns as one body, so nothing can be seen from it')
    names = model.coordinates + (model.following.names if every else ())
    coordinates = motion[[model.nodes.index(name) for name in names]] / at_reference
    # what rests in the rigid motion has no ratio and stays as it is
    return np.where(coordinates == 0.0, 1.0, coordinates)


def _coefficients(names: tuple[str, ...], row: np.ndarray) -> dict[str, float]:
    """Coefficients by node, the positive ones first."""
    return {names[j]: float(row[j]) for j in np.argsort(-row, kind="stable") if row[j]}


def _compliance(name: str, coefficients: dict[str, float], k: float, d: float) -> Element:
    nodes, values = list(coefficients), list(coefficients.values())
    if len(nodes) == 1:
        return Drag(name, nodes[0], stiffness=k * values[0] ** 2, damping=d * values[0] ** 2)
    if len(nodes) == 2 and np.isclose(values[0], -values[1], rtol=1e-9):
        return SpringDamper(name, *nodes, stiffness=k * values[0] ** 2, damping=d * values[0] ** 2)
    return Compliance(name, coefficients, stiffness=k, damping=d)


def _clutch(clutch: Law, coefficients: dict[str, float]) -> Clutch:
    nodes, values = list(coefficients), list(coefficients.values())
    if len(nodes) > 1 and not np.isclose(values[0], -values[1], rtol=1e-9):
        raise TopologyError(f"{clutch.name} slips when everything turns as one body, so it joins no reflected nodes")
    capacity = (clutch.max_torque or 0.0) * abs(values[0])
    return Clutch(clutch.name, *nodes, max_torque=capacity, static_ratio=clutch.static_ratio)
