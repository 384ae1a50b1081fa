"""What several test files need and what takes long to compute: once for all of them."""

import contextlib
import io
from collections import Counter

import matplotlib
import pytest

matplotlib.use("Agg")

import powertrain_ctrl as pt
from powertrain_ctrl.cli import main
from powertrain_ctrl.linear import assembly
from powertrain_ctrl.report import page
from powertrain_ctrl.report.antijerk import _study_of_source


@pytest.fixture(scope="session")
def assemblies():
    """Context that counts how often each driveline is assembled within."""

    @contextlib.contextmanager
    def counting():
        counts, kept = Counter(), assembly._assembled

        def counted(driveline):
            counts[driveline] += 1
            return kept.__wrapped__(driveline)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(assembly, "_assembled", assembly.kept(kept.cache_parameters()["maxsize"])(counted))
            yield counts

    return counting


@pytest.fixture(scope="session")
def source_study():
    """Every design for the source's car on every plant; the report on that car shows the same one."""
    return _study_of_source(pt.SampledPlant(car=pt.examples.conventional()))


@pytest.fixture(scope="session")
def source_command(tmp_path_factory):
    """The report on the source's car as the command line makes it: exit code, what is printed, the `Report`."""
    reports, printed, write_report = [], io.StringIO(), page.write_report

    def recorded(*arguments, **options):
        reports.append(write_report(*arguments, **options))
        return reports[-1]

    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        patch.setattr(page, "write_report", recorded)
        code = main(["report", "--output", str(tmp_path_factory.mktemp("source") / "out")])
    return code, printed.getvalue(), reports[0]


@pytest.fixture(scope="session")
def source_report(source_command):
    return source_command[2]
