"""Frequencies, poles, static gains and frequency responses of any driveline, against arithmetic of many digits."""

import os
import random
import warnings

import mpmath as mp
import numpy as np
import pytest
from exact import EXTREME, ORDINARY, Exact, driveline

import powertrain_ctrl as pt

# More of them for a campaign: POWERTRAIN_CASES=2000
CASES = int(os.environ.get("POWERTRAIN_CASES", 40))
# What 200 digits leave of an exact zero.
DIGITS = mp.mpf(10) ** -150


@pytest.fixture(autouse=True)
def _digits():
    with mp.workdps(200):
        yield


def drivelines(spread):
    for seed in range(CASES):
        car = driveline(seed, spread)
        try:
            pt.assemble(car)
        except pt.TopologyError:
            continue  # gears in a loop that hold each other
        yield seed, car


def correction(determinant, x):
    """Relative step of Newton's method from x to a root."""
    h = mp.mpf(10) ** -60
    value, ahead = determinant(x), determinant(x * (1 + h))
    return abs(value / (ahead - value) * h) if ahead != value else mp.inf


@pytest.mark.parametrize(("spread", "tolerance"), [(ORDINARY, 1e-11), (EXTREME, 1e-4)])
def test_frequencies_are_roots_and_rigid_motions_are_zero(spread, tolerance):
    for seed, car in drivelines(spread):
        M, _, K = Exact(car).matrices()
        result = pt.modes(car)
        assert len(result) == M.rows, seed
        # as many rigid motions as the determinant has roots 0
        small = mp.mpf(10) ** -50
        order = mp.log(abs(mp.det(K + small**2 * M) / mp.det(K + small * M))) / mp.log(small)
        assert round(float(order)) == result.n_rigid, seed
        assert (result.omega[: result.n_rigid] == 0.0).all()
        for omega in result.omega[result.n_rigid :]:
            assert correction(lambda x, M=M, K=K: mp.det(K - x**2 * M), mp.mpf(omega)) < tolerance, (seed, omega)


@pytest.mark.parametrize(("spread", "tolerance"), [(ORDINARY, 1e-10), (EXTREME, 1e-4)])
def test_poles_are_roots_none_of_them_grows_and_none_is_missing(spread, tolerance):
    for seed, car in drivelines(spread):
        M, D, K = Exact(car).matrices()
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            poles = pt.poles(car)
        assert (poles.real <= 0.0).all(), seed
        if said:  # a pole that cannot be trusted is named
            assert spread is EXTREME
            assert "is not to be trusted" in str(said[0].message)
            continue
        moving = poles[poles != 0.0]
        for pole in moving[moving.imag >= 0.0]:
            step = correction(lambda s, M=M, D=D, K=K: mp.det(s**2 * M + s * D + K), mp.mpc(pole.real, pole.imag))
            assert step < tolerance, (seed, pole)
        # the product of all that are not 0 is the lowest coefficient of the determinant over the highest
        small = mp.mpf(10) ** -50
        low = mp.det(small**2 * M + small * D + K) / small ** (2 * M.rows - len(moving))
        product = mp.fprod(mp.mpc(p.real, p.imag) for p in moving) if len(moving) else 1
        assert abs(abs(product * mp.det(M) / low) - 1) < 10 * M.rows * tolerance, seed


def test_a_pole_at_which_the_matrix_is_singular_to_the_last_bit_is_found():
    car = driveline(1775, EXTREME)
    M, D, K = Exact(car).matrices()
    moving = [pole for pole in pt.poles(car) if pole]
    assert len(moving) == 4
    for pole in moving:
        assert correction(lambda s: mp.det(s**2 * M + s * D + K), mp.mpc(pole.real, pole.imag)) < 1e-12


def sampled_channels(car, seed):
    rng = random.Random(seed)
    inputs = rng.sample(pt.assemble(car).inputs, min(2, len(pt.assemble(car).inputs)))
    known = [name for name in pt.state_space(car).output_labels if not name.endswith("_slip_speed")]
    known = [name for name in known if name.removesuffix("_torque") not in car.released]
    return inputs, rng.sample(known, min(4, len(known)))


def test_static_gain_is_the_limit_of_the_response_channel_by_channel():
    for seed, car in drivelines(ORDINARY):
        inputs, outputs = sampled_channels(car, seed)
        outputs = [*outputs, f"{car.nodes[0]}_angle"]
        gain, exact = pt.static_gain(car, inputs, outputs), Exact(car)
        for j, load in enumerate(inputs):
            response = exact.response(mp.mpf(10) ** -70, load.rpartition("_")[0])
            for i, name in enumerate(outputs):
                expected = response[name]
                if abs(expected) > mp.mpf(10) ** 40:
                    assert gain[i, j] == np.inf, (seed, load, name)
                    continue
                kind = name.rpartition("_")[2]
                largest = max(abs(v) for k, v in response.items() if k.endswith(kind) and abs(v) < mp.mpf(10) ** 40)
                assert abs(gain[i, j] - expected) <= 1e-9 * abs(expected) + 1e-12 * largest + 1e-15, (seed, load, name)
                alone = pt.state_space(car, load, name)
                # python-control turns the states by orthogonal matrices and solves: rounding goes by the norms of all that
                # is multiplied, times condition and size of A (Higham, Accuracy and Stability of Numerical Algorithms, 9.3);
                # a feedthrough is a difference of shares of the load, each rounded by its own size
                rounding = np.finfo(float).eps * max(np.linalg.norm(alone.D), float(largest))
                if alone.nstates:
                    size = np.prod([np.linalg.norm(part) for part in (alone.C, np.linalg.inv(alone.A), alone.B)])
                    rounding += 10 * alone.nstates * np.finfo(float).eps * np.linalg.cond(alone.A) * size
                error = abs(float(alone.dcgain()) - gain[i, j])
                assert error <= 1e-6 * abs(gain[i, j]) + rounding, (seed, load, name)


def test_an_output_that_sees_the_free_motion_has_an_exact_integrator():
    for seed, car in drivelines(ORDINARY):
        inputs, outputs = sampled_channels(car, seed)
        for load in inputs:
            for name in outputs:
                G = pt.state_space(car, load, name)
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", RuntimeWarning)
                    gain = float(np.real(G.dcgain()))
                assert np.isinf(gain) == np.isinf(pt.static_gain(car, load, name)[0, 0]), (seed, load, name)
                if np.isinf(gain):
                    assert np.abs(G.poles()).min() == 0.0


def response_of_the_matrices(G, j, omega):
    """Outputs for input j at s = i omega in many digits: a solution in doubles can lose more than the matrices have lost."""
    gain = mp.matrix(G.D[:, j].tolist())
    if not G.nstates:
        return gain
    states = mp.lu_solve(mp.matrix((1j * omega * np.eye(G.nstates) - G.A).tolist()), mp.matrix(G.B[:, j].tolist()))
    return mp.matrix(G.C.tolist()) * states + gain


def test_the_frequency_response_is_that_of_the_elements():
    for seed, car in drivelines(ORDINARY):
        inputs, outputs = sampled_channels(car, seed)
        exact, G = Exact(car), pt.state_space(car, inputs, outputs)
        for j, load in enumerate(inputs):
            node = load.rpartition("_")[0]
            responses = {omega: exact.response(mp.mpc(0, omega), node) for omega in (0.003, 1.7, 90.0, 4e3)}
            found = {omega: response_of_the_matrices(G, j, omega) for omega in responses}
            for i, name in enumerate(outputs):
                alike = [v for r in responses.values() for k, v in r.items() if k.endswith(name.rpartition("_")[2])]
                largest = max(map(abs, alike))
                for omega, response in responses.items():
                    error = abs(found[omega][i] - response[name])
                    if largest < DIGITS:
                        assert abs(found[omega][i]) < DIGITS, (seed, omega, load, name)
                    else:
                        assert error <= 1e-8 * abs(response[name]) + 1e-9 * largest, (seed, omega, load, name)
