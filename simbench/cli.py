"""The command line: a group of verbs, each in a file of `simbench/commands`.

Exit codes: 0 good, 1 a pipeline failed, missed a limit or got worse, 2 usage or bad input, 3 the bench itself
failed (a receipt does not match, a crash of ours), 4 inconclusive, 5 nothing selected.
"""

from __future__ import annotations

import sys
from typing import Any

import click

from simbench.commands.calibrate import calibrate
from simbench.commands.check import check
from simbench.commands.describe import describe, list_
from simbench.commands.doctor import doctor, learn
from simbench.commands.explain import explain
from simbench.commands.frontier import frontier
from simbench.commands.generate import generate, verify
from simbench.commands.init import init
from simbench.commands.reproduce import reproduce
from simbench.commands.run import demo, run
from simbench.commands.score import score
from simbench.commands.stress import stress
from simbench.commands.suite import baseline, compare, plan
from simbench.commands.timeline import timeline
from simbench.commands.view import view

BAD_INPUT = 2


class _Cli(click.Group):
    """Turns usage errors and bad input into one sentence on stderr and exit code 2."""

    def main(self, *args: Any, **kwargs: Any) -> Any:
        try:
            code = super().main(*args, **{**kwargs, "standalone_mode": False})
        except click.exceptions.NoArgsIsHelpError as help_page:
            help_page.show()
            raise SystemExit(BAD_INPUT) from None
        except click.ClickException as error:
            click.echo(f"simbench: {error.format_message()}", err=True)
            raise SystemExit(BAD_INPUT) from None
        except click.Abort:
            raise SystemExit(130) from None
        except Exception as error:
            if not _is_users(error):
                raise
            click.echo(f"simbench: {error}", err=True)
            raise SystemExit(BAD_INPUT) from None
        raise SystemExit(code if isinstance(code, int) else 0)


def _is_users(error: Exception) -> bool:
    """Whether an error is about what the user gave or what the machine lacks."""
    from scenarios.errors import BadInput

    if isinstance(error, BadInput):
        return True
    module = sys.modules.get("simbench.sensors.gl")
    return module is not None and isinstance(error, module.RenderingUnavailable)


@click.group(cls=_Cli, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="simbench")
def main() -> None:
    """Test bench for LiDAR-camera fusion: inject errors into a simulated drive, score what is recovered."""


for verb in (
    baseline, calibrate, check, compare, demo, describe, doctor, explain, frontier, generate, init, learn,
    list_, plan, reproduce, run, score, stress, timeline, verify, view,
):  # fmt: skip
    main.add_command(verb)
