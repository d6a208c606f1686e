"""A pytest plugin: `pytest --simbench-suite FILE` makes the groups of a suite tests beside a repo's own.

One test per group of cases, so that limits and baselines, which are about all runs of a group, hold wherever
the test runs (pytest-xdist too); and one for the canary. It loads nothing of the bench until it is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from simbench.suite.plan import Group
    from simbench.suite.side import Side


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options of the plugin."""
    group = parser.getgroup("simbench", "suites of simbench")
    group.addoption("--simbench-suite", action="append", default=[], metavar="FILE|NAME", help="A suite.")
    group.addoption(
        "--simbench-pipeline", action="append", default=[], metavar="NAME",
        help="In place of the suite's pipelines. May be repeated.",
    )  # fmt: skip
    group.addoption("--simbench-seeds", default=None, metavar="0-3", help="In place of the suite's seeds.")
    group.addoption("--simbench-against", default=None, metavar="FILE", help="A baseline of the suite.")
    group.addoption("--simbench-allow-changed", action="store_true", help="Compare with an older bench.")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(
    session: pytest.Session, config: pytest.Config, items: list[pytest.Item]
) -> None:
    """Add the tests of the suites to what was collected."""
    for target in config.getoption("--simbench-suite"):
        collector = SuiteCollector.from_parent(
            session, name=Path(target).name, nodeid=Path(target).name, target=target
        )
        items.extend(item for item in collector.collect())


class SuiteCollector(pytest.Collector):
    """One suite."""

    def __init__(self, *, target: str, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self.target = target

    def collect(self) -> Iterator[pytest.Item]:
        """A test per group and one for the canary. UsageError: bad input."""
        from scenarios.errors import BadInput
        from scenarios.seeding import seed_list
        from scenarios.suite import load_suite
        from simbench.suite.command import canary_of
        from simbench.suite.plan import groups_of
        from simbench.suite.side import read_side

        option = self.config.getoption
        try:
            seeds = option("--simbench-seeds")
            file = load_suite(self.target)
            groups = groups_of(
                file,
                pipelines=option("--simbench-pipeline"),
                seeds=None if seeds is None else seed_list(seeds),
            )
            against = option("--simbench-against")
            old = None if against is None else read_side(Path(against))
            if old is not None and old.suite != file.suite.name:
                raise BadInput(f"is a baseline of the suite '{old.suite}'", file=against)
            left_out = canary_of(file)
        except ValueError as error:
            raise pytest.UsageError(f"simbench: {error}") from None
        yield CanaryTest.from_parent(self, name="canary", left_out=left_out)
        for group in groups:
            yield GroupTest.from_parent(self, name=group.name, group=group, suite=file.suite.name, old=old)


class Missed(Exception):  # noqa: N818 (a verdict, not a failure of the program)
    """A gate does not pass."""


class SuiteItem(pytest.Item):
    """A test that tells its verdict, not where it was raised."""

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """The sentence alone."""
        if isinstance(excinfo.value, Missed):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """What the terminal calls it."""
        return self.path, None, f"{self.parent.name if self.parent else ''}::{self.name}"


class CanaryTest(SuiteItem):
    """Passes where the case that must fail failed."""

    def __init__(self, *, left_out: Any, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._left_out = left_out

    def runtest(self) -> None:
        """About a second."""
        from simbench.canary import canary

        blind = canary(self._left_out)
        if blind:
            raise Missed(blind)


class GroupTest(SuiteItem):
    """All runs of one group, and all gates about them."""

    def __init__(self, *, group: Group, suite: str, old: Side | None, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._group, self._suite, self._old = group, suite, old
        self.extra_keyword_matches.update((group.block, *group.tags))

    def runtest(self) -> None:
        """Fails unless every gate passes; INCONCLUSIVE is no pass."""
        from simbench.suite.gate import as_lines
        from simbench.suite.judge import Asked, answer
        from simbench.suite.run import side_of_group

        new = side_of_group(self._suite, self._group)
        changed = self.config.getoption("--simbench-allow-changed")
        found = answer(new, self._old, Asked(changed=changed))
        for seed, run in new.groups[self._group.name].runs.items():
            self.user_properties.append((f"hash of seed {seed}", run.scenario))
        if found.exit_code:
            commands = [r.command for r in new.groups[self._group.name].runs.values() if r.status != "ok"]
            lines = [*found.problems, *as_lines(found.gates), *commands[:3]]
            raise Missed("\n".join([found.sentence, *lines]))
