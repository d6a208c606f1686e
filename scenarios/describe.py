"""A concrete scenario as text: YAML that loads again to the very same scenario, whatever the seed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenarios.scenario import Scenario


def describe(scenario: Scenario) -> str:
    """Every number of the scenario in the schema's order; equal scenarios give equal text."""
    import yaml

    class Dumper(yaml.SafeDumper):
        def ignore_aliases(self, data: Any) -> bool:
            return True

    return yaml.dump(
        scenario.model_dump(mode="json"),
        Dumper=Dumper,
        sort_keys=False,
        default_flow_style=None,
        allow_unicode=True,
        width=110,
    )
