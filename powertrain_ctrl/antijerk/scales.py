"""What the gains of an anti-jerk controller are measured by: the plant's own numbers."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.errors import PowertrainError
from ..base.records import Record
from ..linear.assembly import kept
from ..linear.modal import modes
from ..reduction.condensed import two_mass
from ..reduction.twomass import TwoMass
from ..sampled.plant import SampledPlant

# A second mode has a notch of its own from this ratio to the first one on, and up to this share of the sampling frequency.
APART, SEEN = 1.5, 0.45


@dataclass(frozen=True)
class Scales(Record):
    """The scales of a plant.

    Attributes
    ----------
    model : TwoMass
        Design model: its first mode as the actuator sees it.
    second_hz : float or None
        Second elastic mode [Hz], if it is apart from the first and the sampling can see it.
    second_damping_ratio : float
        Its damping ratio [-].
    latency : float
        Lag, delay and half a sample [s]: how late a torque comes, in the slower direction.
    dt : float
        Sample time [s].
    """

    model: TwoMass
    second_hz: float | None
    latency: float
    dt: float
    second_damping_ratio: float = 0.0

    @property
    def gain(self) -> float:
        """J1 omega1 [N m s/rad]: torque over speed of the driving side in the first mode."""
        return self.model.J1 * self.model.omega

    @property
    def radians(self) -> float:
        """Angle of the first mode in a sample [rad]."""
        return self.model.omega * self.dt


@kept(64)
def scales_of(plant: SampledPlant, model: TwoMass | None = None) -> Scales:
    """The scales of a plant, with its own two-mass model if none is given."""
    model = two_mass(plant.linear, driving=plant.engine) if model is None else model
    if model.frequency_hz >= 0.5 / plant.dt:
        raise PowertrainError(
            f"the first mode has {model.frequency_hz:.4g} Hz, permitted: below the Nyquist frequency, "
            f"{0.5 / plant.dt:g} Hz; sample faster"
        )
    result = modes(plant.linear)
    elastic = result.frequency_hz[result.n_rigid :]
    second = float(elastic[1]) if len(elastic) > 1 else 0.0
    is_apart = APART * model.frequency_hz < second < SEEN / plant.dt
    latency = max(plant.lags) + max(plant.delays) + 0.5 * plant.dt
    if not is_apart:
        return Scales(model, None, latency, plant.dt)
    return Scales(model, second, latency, plant.dt, float(result.damping_ratio[result.n_rigid + 1]))
