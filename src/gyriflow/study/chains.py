"""Which brains correspond: whose growth is measured, and through which real brains a start brain's mesh is carried."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

from ..config.root import Config
from ..units import week_tag
from .brains import Brains
from .paths import MATCHED, PIAL, REGISTERED, region_files
from .runs import Runs


@dataclass(frozen=True)
class Chains:
    """The growth series of a configuration, and the chains of brains in them."""

    config: Config
    brains: Brains
    runs: Runs

    @cached_property
    def series(self) -> list[tuple[str, str]]:
        """The series and id of every brain that growth is measured on, the earliest of each series first."""
        return [
            (series, brain)
            for series, brains in self.config.growth_series.items()
            for brain in sorted(brains, key=self.brains.week)
        ]

    @property
    def grown(self) -> list[str]:
        """The brains that growth is measured on."""
        return [brain for _, brain in self.series]

    @property
    def with_thickness(self) -> list[str]:
        """The brains whose cortical thickness gives a curve, where some run follows it."""
        followed = any(self.runs.measured(run, "thickness_mm") for run in self.config.runs)
        return [brain for brain in self.grown if followed and brain in self.brains.with_thickness]

    @cached_property
    def matched_series(self) -> dict[str, set[str]]:
        """The brains of each growth series of surfaces that have the same vertices."""
        return self.config.matched_surfaces

    @cached_property
    def unmatched_starts(self) -> dict[str, str]:
        """Why the surfaces of a growth series with a start brain are not matched, by the series' name."""
        return {
            series: cause
            for series, cause in self.config.unmatched_surfaces.items()
            if set(self.config.growth_series[series]) & set(self.config.start_brains)
        }

    def unmatched(self, brain: str) -> str | None:
        """Returns why the surfaces of a start brain's growth series are not matched, None where they are."""
        return self.config.unmatched_surfaces.get(self.config.own_series(brain))

    def matched(self, *brains: str) -> bool:
        """Returns whether brains have surfaces with the same vertices."""
        return any(set(brains) <= known for known in self.matched_series.values())

    def later(self, brain: str) -> list[str]:
        """Returns a start brain and the brains of its growth series up to where its runs end, one a week.

        All have label volumes, or surfaces with the same vertices.
        """
        start, end = self.brains.week(brain), self.config.last_week(brain)
        # the first brain past the end tells of growth up to it
        past = [week for week in map(self.brains.week, self._series_of(brain)) if week >= end]
        last = min(past, default=end)
        return self._one_a_week(brain, lambda week: start < week <= last)

    def later_weeks(self, brain: str) -> list[float]:
        """Returns the weeks of a start brain and of the real ones that follow it."""
        return [self.brains.week(name) for name in self.later(brain)]

    @cached_property
    def carried(self) -> list[str]:
        """Start brains that real ones of later weeks follow."""
        return [brain for brain in self.config.start_brains if len(self.later(brain)) > 1]

    def correspondence(self, earlier: str, later: str) -> str:
        """Returns the file that says where one brain's points are in another: by matched vertices, or registration."""
        return (MATCHED if self.matched(earlier, later) else REGISTERED).format(earlier=earlier, later=later)

    def between(self, chain: list[str]) -> list[str]:
        """Returns the files that say how each brain of a chain corresponds to the next."""
        return [self.correspondence(*pair) for pair in pairwise(chain)]

    def registered(self, earlier: str, later: str) -> list[dict[str, Any]]:
        """Returns for two brains that are registered the image, which affine of its files is used, and the scheme."""
        return [
            {
                "image": self.config.brain(brain).image,
                "affine_from": self.config.brain(brain).affine_from,
                "scheme": self.brains.registered_scheme(brain),
            }
            for brain in (earlier, later)
        ]

    @property
    def folding_rate_per_s(self) -> Any:
        """The folding's growth rate: a number, {week: number}, or None where it has a map."""
        rate = self.config.folding.growth_rate_per_s
        if isinstance(rate, float):
            return rate
        return dict(rate.weeks or {}) if rate.map is None else None

    def given_regions(self, brain: str) -> dict[str, str]:
        """Returns the regions that a brain gets, with the surfaces that they are given on, and what carries them."""
        given = self.config.regions_from(brain)
        assert given is not None
        surfaces = {f"given_{name}": PIAL[name] for name in ("left", "right", "report")}
        files = {**region_files(f"results/brains/{given}/metrics"), **surfaces}
        return {
            **{name: path.format(brain=given) for name, path in files.items()},
            "correspondence": self.correspondence(given, brain),
        }

    def in_pose(self, *pair: str) -> list[bool]:
        """Returns for two brains whether they correspond in the pose of their surfaces.

        Masks of surfaces do; other brains correspond in the world of their files.
        """
        return [not self.config.brain(name).has_labels and not self.matched(*pair) for name in pair]

    def to_template(self, brain: str) -> list[str]:
        """Returns the file that says where the template's points are in a brain; none for the template itself."""
        template = self.config.metrics.template
        return [] if template in (None, brain) else [self.correspondence(template, brain)]

    def named(self, brain: str) -> dict[str, Any]:
        """Returns how the volume is read that a brain is registered by, and whether its surfaces have its pose."""
        affine_from, scheme = self.config.brain(brain).affine_from, self.brains.registered_scheme(brain)
        return {"affine_from": affine_from, "scheme": scheme, "posed": not self.config.brain(brain).has_labels}

    def posed(self, brain: str) -> list[bool]:
        """Returns the same for the brain of the regions and the brain that gets them."""
        return self.in_pose(self.config.regions_from(brain) or brain, brain)

    def correspondences_later(self, brain: str) -> list[str]:
        """Returns these files from the start brain on."""
        return self.between(self.later(brain))

    def _series_of(self, brain: str) -> list[str]:
        return self.config.growth_series.get(self.config.own_series(brain), [])

    def _correspond(self, brain: str, other: str) -> bool:
        """Returns whether local growth is known between a start brain and another one of its growth series."""
        volumes = self.config.brain(brain).has_labels and self.config.brain(other).has_labels
        return volumes or {brain, other} <= self.matched_series.get(self.config.own_series(brain), set())

    def _one_a_week(self, brain: str, within: Callable[[float], bool]) -> list[str]:
        """Returns a start brain and those of its series that correspond to it and are of some weeks, by week."""
        chosen = {week_tag(self.brains.week(brain)): brain}
        for other in self._series_of(brain):
            if within(self.brains.week(other)) and self._correspond(brain, other):
                chosen.setdefault(week_tag(self.brains.week(other)), other)
        return sorted(chosen.values(), key=self.brains.week)
