"""A plant, its delayed commands and a linear controller as one matrix for a sample; of one plant, or of many at once."""

from __future__ import annotations

import copy

import control
import numpy as np

from .plant import CONTROLLER_INPUTS


class Fold:
    """``(x, controller, command) of the next sample = M z`` where z holds these, and what acts and is asked for.

    Columns of M and entries of z: n states of the plant, ``own`` of the controller, its limited command of the sample before
    (``limited``), the commands that act, the one that arrives (``new``) and the one before (``old``), then ``demand``,
    ``ratio`` and two ``forced`` speeds. Only the limits are left to be applied to the last of the ``rows``.
    """

    def __init__(
        self,
        step: tuple[np.ndarray, np.ndarray, np.ndarray],
        speeds: np.ndarray,
        controller: control.StateSpace | None,
    ):
        """Of a step (Phi, late, early) as of `SampledPlant.step_matrices` and the rows of the speeds; more axes are kept."""
        A, C, B, D = _matrices(controller)
        Phi, late, early = step
        self.n, self.own = Phi.shape[-1], len(A)
        n, own = self.n, self.own
        self.rows = n + own + 1
        self.limited, self.new, self.old, self.demand, self.ratio, self.forced = (n + own + i for i in range(6))
        self.width = self.forced + 2
        demand, engine, wheels, limited, ratio = range(len(CONTROLLER_INPUTS))
        M = np.zeros((*Phi.shape[:-2], self.rows, self.width))
        M[..., :n, :n], M[..., :n, self.new], M[..., :n, self.old] = Phi, late, early
        for part, on_states, on_inputs in ((slice(n, n + own), A, B), (slice(n + own, self.rows), C, D)):
            read = on_inputs[:, [engine, wheels]]
            M[..., part, :n] = read @ speeds
            M[..., part, n : n + own] = on_states
            M[..., part, self.limited] = on_inputs[:, limited]
            M[..., part, self.demand] = on_inputs[:, demand]
            M[..., part, self.ratio] = on_inputs[:, ratio]
            M[..., part, self.forced :] = read
        self.M = M
        # without it and without forces nothing moves before something is asked for
        self.reads_ratio = bool(B[:, ratio].any() or D[:, ratio].any())

    def part(self, places: np.ndarray) -> Fold:
        """Of many plants some."""
        some = copy.copy(self)
        some.M = self.M[places]
        return some

    def begin(self, wanted: np.ndarray, forced: np.ndarray) -> int:
        """The first sample at which something can move; what a force adds to the speeds is (..., samples)."""
        is_pushed = (forced != 0.0).reshape(-1, len(wanted)).any(axis=0)
        return 0 if self.reads_ratio else int(((wanted != 0.0) | is_pushed).argmax())


def _matrices(controller: control.StateSpace | None) -> tuple[np.ndarray, ...]:
    """A, C and B, D on all `CONTROLLER_INPUTS`; without a controller the demand is passed through."""
    if controller is None:
        A, C = np.zeros((0, 0)), np.zeros((1, 0))
        B, D, labels = np.zeros((0, 1)), np.ones((1, 1)), ["torque_demand"]
    else:
        A, C, B, D = (np.asarray(M, dtype=float) for M in (controller.A, controller.C, controller.B, controller.D))
        labels = list(controller.input_labels)
    picked = np.zeros((len(labels), len(CONTROLLER_INPUTS)))
    for i, label in enumerate(labels):
        picked[i, CONTROLLER_INPUTS.index(label)] = 1.0
    return A, C, B @ picked, D @ picked
