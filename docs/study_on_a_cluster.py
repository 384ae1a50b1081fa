"""One study here and on the workers of a dask cluster: ``python docs/study_on_a_cluster.py [address of the scheduler]``.

Without an address it starts two workers on this machine; on a cluster only the address is another, e.g.
``tcp://scheduler:8786``. The workers need this package; ``pip install "powertrain-ctrl[studies]"`` has dask too.
"""

import sys

from distributed import Client

import powertrain_ctrl as pt

N = 64


def launch(car: pt.Driveline) -> dict[str, float]:
    """Time of the lock and heat of the clutch [kJ] of one car."""
    lock = pt.launch(car).events[-1]
    return {"lock": lock.time, "heat": lock.heat / 1000.0}


def main(address: str | None = None) -> None:
    cars = pt.sample(
        pt.examples.conventional(damping="open"),
        {"vehicle.m": 0.1, "clutch.max_torque": 0.1, "drive_shafts.stiffness": 0.1},
        n=N,
        seed=1,
    )
    settings = {"address": address} if address else {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with Client(**settings) as client:
        launches = cars.evaluate(launch, executor=client.get_executor())
        modes = cars.modes(executor=client.get_executor())
    for quantity in ("lock", "heat"):
        low, median, high = launches.percentiles((5.0, 50.0, 95.0))[quantity]
        worst = launches.worst(quantity).variant
        print(f"{quantity}: median {median:.3f}, nine tenths within {low:.3f} to {high:.3f}, largest of car {worst}")
    print(modes)


if __name__ == "__main__":
    main(*sys.argv[1:])
