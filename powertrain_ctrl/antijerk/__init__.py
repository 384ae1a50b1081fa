"""Anti-jerk controllers: discrete-time python-control systems with named signals.

A *feedback* reads ``engine_speed``, ``wheels_speed`` [rad/s] and, where it estimates, ``torque_limited`` [N m], the
limited command of the sample before; it gives ``torque_intervention`` [N m]. A *feedforward* reads ``torque_demand``
[N m] and gives ``feedforward_torque`` [N m]. `one_dof` and `two_dof` put them together to a controller for
`closed_loop`. All speeds and torques are deviations from the state before the manoeuvre.

>>> import powertrain_ctrl as pt
>>> plant = pt.SampledPlant(car=pt.examples.conventional())
>>> model = pt.two_mass(plant.car)
>>> shaping = pt.antijerk.lead_notch(plant, notch_hz=21.1)
>>> feedback = pt.antijerk.speed_difference(plant, gain=6.0, shaping=shaping)
>>> feedforward = pt.antijerk.inverse_notch(plant, model)
>>> controller = pt.antijerk.two_dof(plant, model, feedback, feedforward)
>>> tip_in = pt.closed_loop(plant, controller, pt.ramp(0.0, 0.1, 250.0))
>>> metrics = pt.ride_metrics(tip_in.time, tip_in["vehicle_acceleration"], 250.0 * plant.final_acceleration)
>>> bool(metrics.peak_to_peak < 0.05)
True
"""

from ..base.errors import absent
from ..export.c_code import c_source
from .catalogue import designs
from .feedback import lead_notch, rigid_reference, speed_difference
from .feedforward import inverse_notch, zv_shaper, zvd_shaper
from .optimal import lqg
from .robust import hinf, hinf_synthesis
from .structure import one_dof, scheduled, two_dof
from .tuning import Tuned, tune

__all__ = [
    "Tuned",
    "c_source",
    "designs",
    "hinf",
    "hinf_synthesis",
    "inverse_notch",
    "lead_notch",
    "lqg",
    "one_dof",
    "rigid_reference",
    "scheduled",
    "speed_difference",
    "tune",
    "two_dof",
    "zv_shaper",
    "zvd_shaper",
]

__getattr__ = absent(__name__, __all__)
