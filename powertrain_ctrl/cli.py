"""Command line: ``python -m powertrain_ctrl report``, ``modes``, ``orders`` and ``tune``.

python-control and matplotlib are imported only where a figure or a response is needed, so help and tables are quick.
"""

import argparse
import json
import shlex
import sys
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from . import __version__, examples
from .base.errors import PowertrainError
from .driveline.ends import ends
from .driveline.files import load
from .driveline.toml import plant_table
from .linear.modal import modes
from .orders.critical import critical_speeds
from .orders.engine import Engine
from .orders.firing import HIGHEST
from .report.folder import require_writable
from .report.frequencies import frequency_tables
from .report.origin import Origin
from .report.progress import Progress
from .report.subject import subject_of


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0, or 1 after one line on standard error; 130 where it was stopped.

    Parameters
    ----------
    arguments : list of str, optional
        Without the program's name; None takes those of the process.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> main(["modes", str(pt.examples.path("front_wheel_drive"))])
    mode   f [Hz]  zeta [-]  energy  most strain energy in
    0      0.0000         –       –  rigid motion
    1      0.0000         –       –  rigid motion
    2      9.9741    5.4482    88 %  drive_shafts
    3     60.0078    0.2333    88 %  clutch_springs
    zeta >= 1 in mode 2: what oscillates there, if anything, only the damped poles tell
    0
    """
    given = sys.argv[1:] if arguments is None else list(arguments)
    options = _parser().parse_args(given, argparse.Namespace(arguments=given))
    try:
        options.run(options)
        sys.stdout.flush()
    except PowertrainError as error:
        print(f"powertrain_ctrl: {_one_line(error)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("powertrain_ctrl: stopped; nothing was written", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of a pipe has seen enough; what is still buffered has nowhere to go.
        sys.stdout = None
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="powertrain_ctrl", description="Torsional oscillations of vehicle powertrains."
    )
    parser.add_argument("--version", action="version", version=f"powertrain_ctrl {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="{report,modes,orders,tune}")

    report = commands.add_parser(
        "report", help="frequency tables, figures, report.html and report.md", description=_report.__doc__
    )
    report.add_argument("car", nargs="?", metavar="car.toml", help="driveline file; without it the source's car")
    report.add_argument("--output", default="report", metavar="DIR", help="folder to write to (default: report)")
    report.add_argument("--quick", action="store_true", help="without what takes most of the time")
    report.set_defaults(run=_report)

    table = commands.add_parser("modes", help="the frequency table alone", description=_modes.__doc__)
    table.add_argument("car", metavar="car.toml", help="driveline file")
    table.add_argument("--json", action="store_true", help="for machines: columns as lists")
    table.set_defaults(run=_modes)

    orders = commands.add_parser(
        "orders", help="speeds at which an order of the engine meets a mode", description=_orders.__doc__
    )
    orders.add_argument("car", metavar="car.toml", help="driveline file")
    orders.add_argument("--cylinders", type=int, default=4, metavar="N", help="evenly firing, 1 to 12 (default: 4)")
    orders.add_argument("--node", metavar="NAME", help="node of the engine (default: the driving node of the file)")
    orders.add_argument("--rpm", type=float, nargs=2, default=(600.0, 6000.0), metavar=("LOW", "HIGH"), help="range")
    orders.add_argument("--highest", type=float, default=12.0, metavar="ORDER", help="highest order (default: 12)")
    orders.add_argument("--json", action="store_true", help="for machines: columns as lists")
    orders.set_defaults(run=_orders)

    tuning = commands.add_parser("tune", help="an anti-jerk controller for the car", description=_tune.__doc__)
    tuning.add_argument("car", metavar="car.toml", help="driveline file, its table [plant] says what drives it")
    tuning.add_argument("--structure", default="two degrees of freedom", metavar="NAME", help="of the controller")
    tuning.add_argument(
        "--require", action="append", default=[], metavar="NAME=VALUE", help="a requirement, such as disk_margin=0.9"
    )
    tuning.add_argument("--seed", type=int, default=0, metavar="N", help="of the search (default: 0)")
    tuning.add_argument("--c", metavar="FILE", help="write it as C99, with limits and rate")
    tuning.set_defaults(run=_tune)
    return parser


def _report(options: argparse.Namespace) -> None:
    """Print the frequency tables of a driveline and write figures, report.html and report.md."""
    folder = Path(options.output)
    require_writable(folder)
    car = examples.conventional() if options.car is None else load(options.car)
    name = "Conventional powertrain, first gear" if options.car is None else options.car
    subject = subject_of(car, name)
    _ = subject.as_given  # what is wrong with the driveline is said before anything is printed
    print(f"{name}: {len(car)} elements, {len(car.nodes)} nodes\n")
    for table in frequency_tables(subject):
        print(f"{table.caption}\n\n{table.text}\n")
    origin = Origin(command=shlex.join(["powertrain-ctrl", *options.arguments]), day=date.today().isoformat())
    with Progress(sys.stdout) as progress:
        progress("matplotlib and python-control")
        import matplotlib

        matplotlib.use("Agg")
        from .report.page import write_report
        from .sampled.files import load_plant

        plant = load_plant(options.car) if options.car is not None and plant_table(options.car) else None
        report = write_report(car, folder, name, options.quick, progress, origin, plant=plant)
    figures = sum(file.suffix == ".svg" for file in report.files)
    print(f"\nWritten to {folder}: report.html, report.md, {figures} figures as SVG and PNG")
    print(f"Open {folder / 'report.html'}")


def _modes(options: argparse.Namespace) -> None:
    """Print natural frequencies, damping ratios and where the strain energy is; clutches as the file has them."""
    result = modes(load(options.car))
    print(json.dumps(result.to_dict(), allow_nan=False) if options.json else result)


def _orders(options: argparse.Namespace) -> None:
    """Print the speeds at which an order of the engine has the frequency of a mode; clutches as the file has them."""
    car = load(options.car)
    count, node = options.cylinders, options.node or ends(car).engine
    halves = {0.5 * n: 1.0 for n in range(1, 2 * int(HIGHEST) + 1)}
    engine = Engine(cylinders=count, firing_order=range(1, count + 1), orders=halves)
    result = critical_speeds(car, engine, tuple(options.rpm), nodes=node, highest_order=options.highest)
    print(json.dumps(result.to_dict(), allow_nan=False) if options.json else result)


def _tune(options: argparse.Namespace) -> None:
    """Search for an anti-jerk controller and print what it reaches of what is required; clutches as the file has them."""
    requirements = {}
    for each in options.require:
        name, _, value = each.partition("=")
        try:
            requirements[name] = float(value)
        except ValueError:
            raise PowertrainError(f'requirement "{each}", permitted: NAME=VALUE, such as disk_margin=0.9') from None
    from .antijerk import c_source, tune
    from .base.paths import write_whole
    from .sampled.driving import unit_of
    from .sampled.files import load_plant

    plant = load_plant(options.car)
    tuned = tune(plant, options.structure, requirements, options.seed)
    print(f"{plant!r}\n\n{tuned!r}")
    if options.c is not None:
        write_whole(options.c, c_source(unit_of(tuned.controller, plant)))
        print(f"\nWritten:\n  {options.c}")


def _one_line(error: PowertrainError) -> str:
    return " ".join(str(error).split())
